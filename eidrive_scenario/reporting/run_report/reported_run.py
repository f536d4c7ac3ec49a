"""Validated run in the format of `--json`, as input of pages."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.recording.run_files import read_result
from eidrive_scenario.simulation.result_views import typed
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT

if TYPE_CHECKING:
    from eidrive_scenario.simulation import RunResult

_OF_REPORT = ("folder", "replay", "axes", "sweep")
"""Fields that are no part of a result."""


class ReportedCriterion(BaseModel):
    """Verdict in the format of `--json`."""

    model_config = ConfigDict(extra="ignore")

    name: str
    passed: bool
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    reason: str = ""


class ReportedRun(BaseModel):
    """Run in the format of `--json`."""

    model_config = ConfigDict(extra="ignore")

    scenario: str
    seed: int
    channel: str = ""
    passed: bool
    end_reason: str
    criteria: tuple[ReportedCriterion, ...] = ()
    metrics: dict[str, float | None] = {}
    warnings: tuple[str, ...] = ()
    trace_hash: str = ""
    simulated_s: float = 0.0
    run: int | None = None
    parameters: dict[str, str] = {}
    settings: dict[str, Any] = {}
    settings_sha256: str = ""
    command: str = ""
    axes: dict[str, int | float | str] = {}
    """Values of the axes of a sweep; empty for other runs."""
    sweep: str = ""
    """Store of the sweep; empty for other runs."""
    folder: Path | None = None
    """Folder of the run; None if the result was not read from a file."""
    replay: str = ""
    """Address of the replay in the report; empty without one."""

    def value_of(self, name: str) -> int | float | str | None:
        """Return the value of an axis of a sweep or of a parameter, as a number if it is one; None without it."""
        if name in self.axes:
            return self.axes[name]
        found = typed(self.parameters[name]) if name in self.parameters else None
        return found if found is None or isinstance(found, int | float) else str(found)

    @property
    def is_swept(self) -> bool:
        """Whether the run is one of a sweep, whose values stand for themselves even if each occurs once."""
        return bool(self.axes or self.sweep)

    @property
    def is_judged(self) -> bool:
        """False for a run that ended without a criterion, unless it was accepted as it is."""
        return self.passed or bool(self.criteria) or not self.finished

    @property
    def finished(self) -> bool:
        """False if the run ended at its time limit."""
        return self.end_reason != TIME_LIMIT


def read_runs(paths: Iterable[Path]) -> tuple[list[ReportedRun], list[Diagnostic]]:
    """Return the runs of these result files, and the errors of files that are damaged or not results."""
    runs: list[ReportedRun] = []
    errors: list[Diagnostic] = []
    for path in paths:
        try:
            runs.append(parse_run(read_result(path), path).model_copy(update={"folder": path.parent}))
        except InputError as error:
            errors += error.diagnostics
    return runs, errors


def parse_run(result: Mapping[str, Any] | ReportedRun, source: str | Path = "") -> ReportedRun:
    """Return a validated run from an object in the format of `--json`, read from the optional file `source`.

    A validated run is returned unchanged. Raise InputError if the object is invalid.
    """
    if isinstance(result, ReportedRun):
        return result
    try:
        return ReportedRun.model_validate({key: value for key, value in result.items() if key not in _OF_REPORT})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(
            Diagnostic(
                f"result: {key[:200]!r}: {first['msg'].lower()}",
                "give an object that eidrive run --json prints",
                str(source),
            )
        ) from error


def run_of_result(result: RunResult, scenario: str) -> ReportedRun:
    """Return a run of this process, with its folder if it has one, and with the scenario as the report names it."""
    from eidrive_scenario.experiments.single_run import as_json_text

    run = parse_run(json.loads(as_json_text(replace(result, scenario=scenario))))
    return run.model_copy(update={"folder": result.folder})
