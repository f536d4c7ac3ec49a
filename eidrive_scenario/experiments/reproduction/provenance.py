"""Origin of the results of a part: commit, versions, seeds and durations, which differ between equal results."""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.reproduction.digests import code_digest
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.files.bounded_json import load_json
from eidrive_scenario.library import library_path
from eidrive_scenario.resolved_settings import ENGINE

FILE = "provenance.json"
"""Name of the file in the folder of the results."""


def read_provenance(out: Path) -> dict[str, Any]:
    """Return the origins of the parts in a folder by their names; empty without a file.

    Raise SettingError if the file is damaged.
    """
    path = out / FILE
    if not path.is_file():
        return {}
    try:
        known = load_json(path.read_bytes())
    except ValueError as error:
        raise SettingError(Diagnostic(f"the file is damaged: {error}", "remove it", str(path))) from error
    if not isinstance(known, dict):
        raise SettingError(Diagnostic("the file is damaged: not a JSON object", "remove it", str(path)))
    return known


def write_provenance(
    out: Path, part: str, values: Mapping[str, Any], *, added: int, elapsed_s: float, processes: int
) -> None:
    """Add the origin of a part to the file of a folder, which keeps those of other parts.

    values     further values of the part, such as seeds
    added      number of runs of this call; without one, commit and duration remain those of the call that computed
    elapsed_s  duration of this call [s];  processes  number of its processes
    """
    known = read_provenance(out)
    code = {"version": version(ENGINE), "code": code_digest(), "python": platform.python_version()}
    call = {
        "commit": commit(),
        "runs_of_last_call": added,
        "last_call_s": round(elapsed_s, 1),
        "processes": processes,
    }
    former = known.get(part)
    if not added and isinstance(former, dict) and former.get("code") == code["code"]:
        call = {name: former.get(name) for name in call}
    parts = {**known, part: {**code, **call, **values}}
    with write_atomically(out / FILE) as stream:
        stream.write((json.dumps(parts, indent=1, sort_keys=True) + "\n").encode())


def commit() -> str | None:
    """Return the commit of the checkout, followed by `+` if files differ from it; None outside of a checkout."""
    folder = library_path()
    try:
        if Path(_git(folder, "rev-parse", "--show-toplevel")) != folder.resolve().parent:
            return None  # an installed package within the checkout of another project
        found = _git(folder, "rev-parse", "HEAD")
        return found + ("+" if _git(folder, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(folder: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True, timeout=30
    ).stdout.strip()
