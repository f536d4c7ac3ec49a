"""Diagnostics of `eidrive check` as a SARIF 2.1.0 log (OASIS), for the code scanning of GitHub and of editors."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import quote

from eidrive_scenario.checks.rule import Level
from eidrive_scenario.checks.scenario_checks import ALL_RULES
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.files.bounded import is_regular_file, read_regular_file

OUTSIDE_RULES = "scenario"
"""Id of the rule of diagnostics outside of rules: the schema, the setup of the run, and warnings of readers."""
_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_ROOT = "%SRCROOT%"
"""Name of the folder to which relative paths refer: that of the command."""
_LARGEST = 64 * 2**20
"""Maximum size of a file whose lines are measured [bytes]."""


def write_sarif(
    diagnostics: Iterable[tuple[Level, Diagnostic]], out: Path, *, folder: Path, aborted: Sequence[str] = ()
) -> None:
    """Write the log of a check. Raise SettingError if it cannot be written.

    diagnostics  of all files, each once
    folder       folder of the command; paths of files below it are relative to it
    aborted      files and messages of checks that an error or the wall limit ended
    """
    with write_atomically(out) as stream:
        stream.write(json.dumps(_log(diagnostics, folder, aborted), indent=1).encode())


def _log(diagnostics: Iterable[tuple[Level, Diagnostic]], folder: Path, aborted: Sequence[str]) -> dict[str, Any]:
    rules = [(rule.name, rule.level, rule.summary) for rule in ALL_RULES]
    rules.append((OUTSIDE_RULES, Level.ERROR, "a violation of the schema, or an error of the setup of a run"))
    indices = {name: index for index, (name, _, _) in enumerate(rules)}
    results, notifications = [], []
    for level, diagnostic in diagnostics:
        hint = f"; {diagnostic.hint}" if diagnostic.hint else ""
        message = {"text": f"{diagnostic.message}{hint}"}
        location = _location(diagnostic, folder)
        if location is None:  # of an option or a missing file, which code scanning cannot show
            source = f"{diagnostic.source}: " if diagnostic.source else ""
            notifications.append({"level": level.value, "message": {"text": f"{source}{message['text']}"}})
            continue
        name = diagnostic.rule or OUTSIDE_RULES
        results.append(
            {
                "ruleId": name,
                "ruleIndex": indices[name],
                "level": level.value,
                "message": message,
                "locations": [{"physicalLocation": location}],
            }
        )
    driver = {
        "name": "eidrive check",
        "version": version("eidrive-scenario"),
        "rules": [
            {
                "id": name,
                "shortDescription": {"text": summary},
                "help": {"text": _help(name, summary), "markdown": _help(f"`{name}`", summary)},
                "defaultConfiguration": {"level": level.value},
            }
            for name, level, summary in rules
        ],
    }
    errors = [{"level": "error", "message": {"text": text}} for text in aborted]
    invocation = {
        "executionSuccessful": not aborted,
        "toolConfigurationNotifications": notifications,
        "toolExecutionNotifications": errors,
    }
    run = {
        "tool": {"driver": driver},
        "invocations": [invocation],
        "originalUriBaseIds": {_ROOT: {"uri": f"{folder.as_uri().rstrip('/')}/"}},
        "columnKind": "unicodeCodePoints",
        "results": results,
    }
    return {"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}


def _help(name: str, summary: str) -> str:
    return f"{name}: {summary}. docs/checks.md of eidrive-scenario describes all rules; --ignore disables one."


def _location(diagnostic: Diagnostic, folder: Path) -> dict[str, Any] | None:
    """Return file and region of a diagnostic; None if its source is no file."""
    path = folder / diagnostic.source
    if not diagnostic.source or not is_regular_file(path):
        return None
    location: dict[str, Any] = {"artifactLocation": _artifact(path, folder)}
    if diagnostic.line is not None:
        columns = _columns(path)
        region = {"startLine": diagnostic.line}
        if diagnostic.line <= len(columns):
            region["startColumn"], region["endColumn"] = columns[diagnostic.line - 1]
        location["region"] = region
    return location


def _artifact(path: Path, folder: Path) -> dict[str, str]:
    """Return the address of a file: relative to the folder if it is below it."""
    whole = path.resolve()
    if whole.is_relative_to(folder.resolve()):
        return {"uri": quote(os.fsencode(whole.relative_to(folder.resolve()).as_posix())), "uriBaseId": _ROOT}
    return {"uri": whole.as_uri()}


@cache
def _columns(path: Path) -> list[tuple[int, int]]:
    """Return the first column of the text of each line and the one after it; [] for a file that is not readable."""
    try:
        text = read_regular_file(path, _LARGEST).decode("utf-8-sig", errors="replace")
    except (OSError, ValueError):
        return []
    lines = [line.rstrip() for line in text.split("\n")]
    return [(len(line) - len(line.lstrip()) + 1, len(line) + 1) for line in lines]
