"""Run in the format of `--json`, as pages and tables of runs read it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import Diagnostic, InputError, quoted
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.simulation.result import typed_parameters
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT

_OF_REPORT = ("folder", "replay", "axes", "sweep")
"""Fields that are no part of a result."""
_EXPECTED = "give an object that eidrive run --json prints, such as RunResult.as_json()"


OUTCOMES = ("failed", "did not finish", "not judged", "passed")
"""Outcomes of a run in the order of pages: what needs attention comes first."""


class ReportedRun(BaseModel):
    """Run in the format of `--json`."""

    model_config = ConfigDict(extra="ignore")

    scenario: str
    seed: int
    channel: str = ""
    passed: bool
    end_reason: str
    criteria: tuple[Verdict, ...] = ()
    metrics: dict[str, float | None] = {}
    warnings: tuple[str, ...] = ()
    trace_hash: str = ""
    simulated_s: float = 0.0
    wall_s: float = 0.0
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
        strings = self.settings.get("strings")
        return typed_parameters(self.parameters, strings if isinstance(strings, list) else ()).get(name)

    @property
    def is_swept(self) -> bool:
        """Whether the run is one of a sweep, whose values stand for themselves even if each occurs once."""
        return bool(self.axes or self.sweep)

    @property
    def is_judged(self) -> bool:
        """False for a run that ended without a criterion, unless it was accepted as it is."""
        return self.passed or bool(self.criteria) or not self.finished

    @property
    def outcome(self) -> str:
        """Return one of OUTCOMES: a run that reached its time limit did not finish, unless a criterion failed."""
        if self.passed:
            return "passed"
        if not self.is_judged:
            return "not judged"
        has_failed = any(not criterion.passed for criterion in self.criteria)
        return "failed" if self.finished or has_failed else "did not finish"

    @property
    def finished(self) -> bool:
        """False if the run ended at its time limit."""
        return self.end_reason != TIME_LIMIT


def parse_run(result: Mapping[str, Any] | ReportedRun, source: str | Path = "") -> ReportedRun:
    """Return a validated run from an object in the format of `--json`, read from the optional file `source`.

    A validated run is returned unchanged. Raise InputError if the object is invalid.
    """
    if isinstance(result, ReportedRun):
        return result
    if not isinstance(result, Mapping):
        raise InputError(Diagnostic(f"result is {quoted(result)}", _EXPECTED, str(source)))
    try:
        return ReportedRun.model_validate({key: value for key, value in result.items() if key not in _OF_REPORT})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(
            Diagnostic(
                f"result: {key[:200]!r}: {first['msg'].lower()}",
                _EXPECTED,
                str(source),
            )
        ) from error
