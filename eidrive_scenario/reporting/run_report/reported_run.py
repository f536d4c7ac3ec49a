"""A run as `--json` prints it, checked: what pages show of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT


class ReportedCriterion(BaseModel):
    """A verdict as `--json` prints it."""

    model_config = ConfigDict(extra="ignore")

    name: str
    passed: bool
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    reason: str = ""


class ReportedRun(BaseModel):
    """A run as `--json` prints it."""

    model_config = ConfigDict(extra="ignore")

    scenario: str
    seed: int
    channel: str = ""
    passed: bool
    end_reason: str
    criteria: tuple[ReportedCriterion, ...] = ()
    metrics: dict[str, float | None] = {}
    trace_hash: str = ""
    simulated_s: float = 0.0
    run: int | None = None
    parameters: dict[str, str] = {}
    settings: dict[str, Any] = {}
    settings_sha256: str = ""
    command: str = ""

    @property
    def finished(self) -> bool:
        """False where the run was cut off by its time limit."""
        return self.end_reason != TIME_LIMIT


def reported(result: Mapping[str, Any], source: str | Path = "") -> ReportedRun:
    """Return a checked run from the object that `--json` prints, read from the file `source` if that is given.

    Raise InputError if it is not one.
    """
    try:
        return ReportedRun.model_validate(result)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(
            Diagnostic(
                f"result: {where[:200]!r}: {first['msg'].lower()}",
                "give an object that eidrive run --json prints",
                str(source),
            )
        ) from error
