"""Validated runs as input of pages: results in the format of `--json`, and the stores of sweeps."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eidrive_scenario.errors import Diagnostic, InputError, SettingError, counted
from eidrive_scenario.experiments.reported_run import ReportedRun, parse_run
from eidrive_scenario.experiments.sweeps.results import runs_with_stores
from eidrive_scenario.experiments.sweeps.store import FOLDER, StoredRun
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.recording.run_files import RESULT, read_result, result_of

if TYPE_CHECKING:
    from eidrive_scenario.simulation import RunResult


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
        if not run.has_verdict:
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
    """Return a stored run, with the folder of its files and their result if they are those of this run."""
    axes = {name: value for name, value in run.point.items() if name != "run"}
    report = {"axes": axes, "sweep": str(store)}
    folder = run.result.get(FOLDER)
    if isinstance(folder, str):
        path = store.parent / folder / RESULT
        kept: dict[str, Any] = {}
        with suppress(InputError):
            kept = read_result(path)
        if kept and kept["trace_hash"] == run.result.get("trace_hash"):
            reported = parse_run({**kept, "run": run.run}, path)
            return reported.model_copy(update={**report, "folder": path.parent})
    return parse_run(_as_result(run), store).model_copy(update=report)


def _as_result(run: StoredRun) -> dict[str, Any]:
    """Return a stored run in the format of `--json`, without reasons and units of criteria, and texts of warnings."""
    result = run.result
    count = result.get("warnings")
    settings = json.loads(run.settings) if run.settings else {}
    of_criteria = {name + end for name in run.criteria for end in _ENDINGS}
    criteria = [{"name": name, **{end[1:]: result.get(name + end) for end in _ENDINGS}} for name in run.criteria]
    return {
        "scenario": run.scenario,
        "run": run.run,
        "seed": run.seed,
        "channel": str(result.get("channel", "")),
        "passed": result.get("passed"),
        "end_reason": result.get("end_reason"),
        "criteria": criteria,
        "metrics": {
            name: value for name, value in result.items() if name not in of_criteria and _is_metric(name, value)
        },
        "warnings": [f"{counted(count, 'warning')}, printed by the command of the run"] if count else [],
        "parameters": settings.get("parameters", {}),
        "settings": settings,
        "settings_sha256": result.get("settings_sha256", ""),
        "trace_hash": result.get("trace_hash", ""),
        "simulated_s": result.get("simulated_s", 0.0),
        "command": run.command,
    }


def _is_metric(name: str, value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and name not in _FIXED and not name.startswith(_PREFIXES)
