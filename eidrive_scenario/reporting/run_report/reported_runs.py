"""Validated runs as input of pages: results in the format of `--json`, and the stores of sweeps."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.experiments.sweeps.results import runs_with_stores
from eidrive_scenario.experiments.sweeps.store import FAILED, FOLDER, PASSED, StoredRun
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.recording.run_files import RESULT, read_result, result_of
from eidrive_scenario.simulation.result import typed
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT

if TYPE_CHECKING:
    from eidrive_scenario.simulation import RunResult


_OF_REPORT = ("folder", "replay", "axes", "sweep")
"""Fields that are no part of a result."""


OUTCOMES = ("failed", "did not finish", "not judged", "passed")
"""Outcomes of a run in the order of pages: what needs attention comes first."""


class ReportedCriterion(BaseModel):
    """Verdict in the format of `--json`."""

    model_config = ConfigDict(extra="ignore")

    name: str
    passed: bool
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    reason: str = ""
    first_violation: float | None = None
    violation_state: tuple[str, ...] = ()
    """Lines about the stations at the first violation, of which the first has its time; empty for older results."""


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
        value = typed(self.parameters[name]) if name in self.parameters else None
        return value if value is None or isinstance(value, int | float) else str(value)

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


def run_of_recording(recording: Path, report: DamageReport) -> ReportedRun | None:
    """Return the run whose result is in the folder of its recording.

    Return None without a result, and for an invalid one, which is added to the report.
    """
    try:
        result = result_of(recording)
        return None if result is None else parse_run(result, recording.with_name(RESULT))
    except InputError as error:
        report.add(f"the verdicts are not shown: {error}")
        return None


def run_of_result(result: RunResult, scenario: str) -> ReportedRun:
    """Return a run of this process, with its folder if it has one, and with the scenario as the report names it."""
    from eidrive_scenario.experiments.single_run import as_json_text

    run = parse_run(json.loads(as_json_text(replace(result, scenario=scenario))))
    return run.model_copy(update={"folder": result.folder})


MOST_RUNS = 20_000
"""Maximum number of runs of stores in a report."""
_FIXED = frozenset({"dt", "simulated_s", "wall_s", "warnings", "exit_code", "seed", "run", "passed", "end_reason"})
"""Columns of a result that are no metrics."""
_PREFIXES = ("parameter.", "channel.")
_ENDINGS = (".passed", ".value", ".limit")


def read_sweeps(stores: Sequence[Path]) -> tuple[list[ReportedRun], list[str]]:
    """Return the runs with a verdict in these stores, and a line for each reason of runs without one.

    A run whose files were kept has the folder of its recording, and the criteria with the reasons of its result.
    Raise SettingError if a file is not a store, or if the stores have too many runs.
    """
    runs: list[ReportedRun] = []
    without: Counter[tuple[str, str]] = Counter()
    commands: dict[tuple[str, str], str] = {}
    for run, store in runs_with_stores(stores):
        if run.status not in (PASSED, FAILED):
            reason = run.status, run.error.partition("\n")[0]
            without[reason] += 1
            commands.setdefault(reason, run.command)
            continue
        if len(runs) == MOST_RUNS:
            message = f"the stores have more than {MOST_RUNS} runs with a verdict"
            raise SettingError(Diagnostic(message, "eidrive results prints and exports larger sweeps", str(store)))
        runs.append(_reported(run, store))
    paths = ", ".join(map(str, stores))
    lines = [
        f"{paths}: {count} {status}: {message}"
        + (f" (such as {commands[status, message]})" * bool(commands[status, message]))
        for (status, message), count in without.most_common()
    ]
    return runs, lines


def _reported(run: StoredRun, store: Path) -> ReportedRun:
    kept = _kept_result(run, store)
    if kept is None:
        reported = parse_run(_as_result(run), store)
    else:
        reported = parse_run(kept[1], kept[0]).model_copy(update={"folder": kept[0].parent})
    axes = {name: value for name, value in run.point.items() if name != "run"}
    return reported.model_copy(update={"axes": axes, "sweep": str(store)})


def _kept_result(run: StoredRun, store: Path) -> tuple[Path, Mapping[str, Any]] | None:
    """Return file and content of the result in the folder of the run; None without that of this run."""
    folder = run.result.get(FOLDER)
    if not isinstance(folder, str):
        return None
    path = store.parent / folder / RESULT
    try:
        result = read_result(path)
    except InputError:
        return None
    return (path, {**result, "run": run.run}) if result["trace_hash"] == run.result.get("trace_hash") else None


def _as_result(run: StoredRun) -> dict[str, Any]:
    """Return a stored run in the format of `--json`, without reasons and units of criteria, and texts of warnings."""
    result = run.result
    count = result.get("warnings")
    settings = json.loads(run.settings) if run.settings else {}
    names = [name.removesuffix(".passed") for name in result if name.endswith(".passed")]
    criteria = [
        {"name": name, **{end[1:]: result.get(name + end) for end in _ENDINGS}}
        for name in names
        if result.get(f"{name}.passed") is not None
    ]
    return {
        "scenario": run.scenario,
        "run": run.run,
        "seed": run.seed,
        "channel": str(result.get("channel", "")),
        "passed": result.get("passed"),
        "end_reason": result.get("end_reason"),
        "criteria": criteria,
        "metrics": {name: value for name, value in result.items() if _is_metric(name, value)},
        "warnings": [f"{count} warning{'' if count == 1 else 's'}, printed by the command of the run"] if count else [],
        "parameters": settings.get("parameters", {}),
        "settings": settings,
        "settings_sha256": result.get("settings_sha256", ""),
        "trace_hash": result.get("trace_hash", ""),
        "simulated_s": result.get("simulated_s", 0.0),
        "command": run.command,
    }


def _is_metric(name: str, value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and name not in _FIXED and not name.startswith(_PREFIXES) and not name.endswith(_ENDINGS)
