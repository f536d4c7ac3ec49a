"""Results of sweeps as tables."""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.errors import Diagnostic, SettingError, counted
from eidrive_scenario.experiments.statistics.intervals import Proportion, anytime_interval, clopper_pearson, wilson
from eidrive_scenario.experiments.sweeps.axes import axis_identity, without_run
from eidrive_scenario.experiments.sweeps.result_folders import SCENARIO, folder_runs, varying, with_axes
from eidrive_scenario.experiments.sweeps.store import FAILED, PASSED, REPEATABLE, STATUSES, ResultStore, StoredRun
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.recording.text.csv_writer import neutralize_formula

INTERVALS: Mapping[str, Callable[..., Proportion]] = {
    "anytime": anytime_interval,
    "wilson": wilson,
    "exact": clopper_pearson,
}
"""Intervals of success rates by name. That of a confidence sequence is valid while runs are added; the others are for a
number of runs that was fixed before."""
Identity: TypeAlias = tuple[str, int | None, int, tuple[tuple[str, Any], ...]]
"""Scenario, run of a distribution, seed, and values of the axes of a run."""


@dataclass(frozen=True)
class PointSummary:
    """Runs of one combination of values.

    point   values of the axes
    counts  number of runs by status
    rate    share of passed runs among passed and failed ones
    """

    point: Mapping[str, Any]
    counts: Mapping[str, int]
    rate: Proportion | None


def stored_runs(paths: Sequence[Path], warn: Callable[[str], None] = warnings.warn) -> Iterator[StoredRun]:
    """Yield the runs of several stores and folders of results; of equal runs, the last one with a verdict.

    warn  function that gets a line for each damaged result below a folder, which is omitted

    Raise InputError for a damaged store, and for a damaged result that `paths` name.
    """
    (runs,) = stored_sides(paths, warn=warn)
    return iter(runs)


def stored_sides(*sides: Sequence[Path], warn: Callable[[str], None] = warnings.warn) -> list[list[StoredRun]]:
    """Return the runs of each side as `stored_runs`, all with the same axes.

    They are those of all stores, and the settings that vary within the folders of any side. A run in the store and in
    the folder of a sweep is the one of the store.
    """
    stores = [[run for run, _ in _all_runs(path for path in paths if not _has_results(path))] for paths in sides]
    folders = [
        _without_copies(folder_runs([path for path in paths if _has_results(path)], warn), swept)
        for paths, swept in zip(sides, stores, strict=True)
    ]
    varied = [name for runs in folders for name in varying(runs)]
    axes = _axes([*(name for runs in stores for run in runs for name in run.point), *varied])
    joined: list[list[StoredRun]] = []
    several = [[*swept, *runs] for swept, runs in zip(stores, folders, strict=True)]
    every = with_axes(chain.from_iterable(several), axes)
    for side in several:
        last = _last_verdicts((run, Path()) for run in islice(every, len(side)))
        joined.append(sorted((run for run, _ in last), key=lambda run: (run.number, run.key)))
    return joined


def _without_copies(runs: Iterable[StoredRun], swept: Iterable[StoredRun]) -> list[StoredRun]:
    """Return the runs of folders that are not those of a sweep, which may have kept the files of its runs."""
    keys = {_result_key(run) for run in swept}
    return [run for run in runs if _result_key(run) is None or _result_key(run) not in keys]


def _result_key(run: StoredRun) -> tuple[Any, Any] | None:
    """Return what only copies of a run have in common; None for a run without a result."""
    settings = run.result.get("settings_sha256")
    return (settings, run.result.get("trace_hash")) if settings else None


def _has_results(path: Path) -> bool:
    """Whether a path is a folder or a file of results, not a store."""
    return os.path.isdir(path) or path.suffix == ".json"


def runs_with_stores(paths: Sequence[Path]) -> Iterator[tuple[StoredRun, Path]]:
    """Yield the runs of several stores with their store, in the order of the stores, all with the same axes.

    Of equal runs, the last one counts that was not aborted or crashed, as another try may have a verdict.
    """
    stored = list(_all_runs(paths))
    runs = with_axes((run for run, _ in stored), _axes(name for run, _ in stored for name in run.point))
    yield from _last_verdicts(zip(runs, (path for _, path in stored), strict=True))


def _axes(names: Iterable[str]) -> dict[str, str]:
    """Return the names of different axes by `axis_identity`, in order of appearance."""
    axes: dict[str, str] = {}
    for name in names:
        axes.setdefault(axis_identity(name), name)
    return axes


def _all_runs(paths: Iterable[Path]) -> Iterator[tuple[StoredRun, Path]]:
    for path in paths:
        with ResultStore.read(path) as store:
            for run in store.runs():
                yield run, path


def _last_verdicts(runs: Iterable[tuple[StoredRun, Path]]) -> Iterable[tuple[StoredRun, Path]]:
    """Return the last run with each key, unless it alone was aborted or crashed."""
    last: dict[str, tuple[StoredRun, Path]] = {}
    for run, path in runs:
        if run.key not in last or run.status not in REPEATABLE or last[run.key][0].status in REPEATABLE:
            last[run.key] = run, path
    return last.values()


def identity(run: StoredRun) -> Identity:
    """Return what distinguishes a run from the others of its sweep."""
    return run.scenario, run.run, run.seed, tuple(sorted(without_run(run.point).items()))


def partner_identity(run: StoredRun, axis: str) -> Identity:
    """Return what a run has in common with those at other values of an axis or of a parameter of a distribution.

    The numbers of the runs of a distribution depend on its parameters: all other parameters replace them.
    """
    varied = _varied_parameters(run)
    others = {name: value for name, value in {**without_run(run.point), **varied}.items() if name != axis}
    scenario = "" if axis == SCENARIO else run.scenario
    return scenario, None if axis in varied else run.run, run.seed, tuple(sorted(others.items()))


def values_of(runs: Iterable[StoredRun]) -> dict[str, list[Any]]:
    """Return the values of each axis, and of each parameter that a distribution varies.

    Numbers are in ascending order, then texts in order of appearance.
    """
    return _values_of({**run.point, **_varied_parameters(run)} for run in runs)


def _values_of(points: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    values: dict[str, dict[Any, None]] = {}
    for point in points:
        for name, value in point.items():
            values.setdefault(name, {})[value] = None
    return {name: sorted(several, key=_number_first) for name, several in values.items()}


def value_of(run: StoredRun, name: str) -> Any:
    """Return the value of an axis, or of a parameter that a distribution varies; None without it."""
    return run.point[name] if name in run.point else _varied_parameters(run).get(name)


def _number_first(value: Any) -> tuple[bool, float]:
    return (False, value) if isinstance(value, int | float) else (True, 0.0)


def indistinct(runs: Sequence[StoredRun]) -> str:
    """Return a warning of runs that differ only in files or in settings that are no axes; empty without such runs.

    Those of two scenarios whose files have one name differ in files, too.
    """
    count = len(runs) - len({identity(run) for run in runs})
    if not count:
        return ""
    what = "1 run repeats another one" if count == 1 else f"{count} runs repeat other ones"
    return f"{what} with other options, after a change of a file, or of another scenario whose file has this name"


def mixed_versions(runs: Iterable[StoredRun]) -> str:
    """Return a warning of runs by different versions of a package; empty without such runs.

    A store has runs of one version of the engine, but combined stores and packages of extensions may differ.
    """
    packages: dict[str, dict[str, int]] = {}
    for run in runs:
        for name, version in _settings_of(run).versions.items():
            counts = packages.setdefault(name, {})
            counts[version] = counts.get(version, 0) + 1
    texts = [
        f"{name} {', '.join(f'{version} ({count})' for version, count in sorted(counts.items()))}"
        for name, counts in sorted(packages.items())
        if len(counts) > 1
    ]
    return f"the success rates mix runs of different versions: {'; '.join(texts)}" if texts else ""


def warned(runs: Sequence[StoredRun]) -> str:
    """Return the number of runs with warnings, and the command that prints those of the first; empty without any."""
    commands = [run.command for run in runs if run.result.get("warnings")]
    return describe_warned(len(commands), len(runs), commands[0]) if commands else ""


def describe_warned(count: int, total: int, command: str) -> str:
    """Return that `count` of `total` runs have warnings, and the command that prints those of the first, if known."""
    text = f"{count} of {counted(total, 'run')} {'has' if count == 1 else 'have'} warnings"
    return f"{text}; to print those of the first: {command}" if command else text


def summaries(
    runs: Iterable[StoredRun], *, by: Sequence[str] | None = None, interval: str = "anytime", confidence: float = 0.95
) -> list[PointSummary]:
    """Return the runs by combination of values: numbers in ascending order, texts in the order of the runs.

    by  names that distinguish combinations: axes, `scenario`, and parameters of a distribution; None: all axes, and the
        others that have several values

    Raise SettingError for a name that no run has, or an unknown interval.
    """
    if interval not in INTERVALS:
        raise SettingError(Diagnostic(f"--interval: unknown interval {interval!r}", f"expected {', '.join(INTERVALS)}"))
    axes: dict[str, None] = {}
    others: dict[str, set[Any]] = {"scenario": set()}
    outcomes: list[tuple[dict[str, Any], str]] = []
    for run in runs:
        axes.update(dict.fromkeys(run.point))
        varied = {"scenario": run.scenario, **_varied_parameters(run)}
        for name, value in varied.items():
            others.setdefault(name, set()).add(value)
        outcomes.append(({**varied, **run.point}, run.status))
    names = dict.fromkeys(["scenario", *axes, *others])
    columns = [name for name in names if name in axes or len(others[name]) > 1] if by is None else by
    groups: dict[tuple[tuple[str, Any], ...], dict[str, int]] = {}
    for values, status in outcomes:
        chosen = tuple((name, values[name]) for name in columns if name in values)
        groups.setdefault(chosen, dict.fromkeys(STATUSES, 0))[status] += 1
    unknown = [name for name in by or () if name not in names]
    if unknown:
        raise SettingError(Diagnostic(f"--by: no axis {unknown[0]!r}", f"expected {', '.join(names)}"))
    summarized = []
    for point, counts in groups.items():
        trials = counts[PASSED] + counts[FAILED]
        rate = INTERVALS[interval](counts[PASSED], trials, confidence) if trials else None
        summarized.append(PointSummary(dict(point), {name: count for name, count in counts.items() if count}, rate))
    points = [summary.point for summary in summarized]
    lacking = dict.fromkeys(name for point in points for name in point)  # a missing value precedes texts
    values = _values_of([lacking, *points])
    ranks = {name: {value: rank for rank, value in enumerate(several)} for name, several in values.items()}
    return sorted(summarized, key=lambda summary: [rank[summary.point.get(name)] for name, rank in ranks.items()])


def _varied_parameters(run: StoredRun) -> dict[str, Any]:
    """Return the values of the parameters that the distribution of a run varies; empty for other runs."""
    if run.run is None:
        return {}
    if not run.settings:  # a run that did not start has these parameters only
        prefix = "parameter."
        return {name.removeprefix(prefix): value for name, value in run.result.items() if name.startswith(prefix)}
    return {
        name: run.result[column] for name in _settings_of(run).varied if (column := f"parameter.{name}") in run.result
    }


class _Settings(msgspec.Struct):
    """Settings of a run that are read here."""

    varied: tuple[str, ...] = ()
    versions: dict[str, str] = {}


def _settings_of(run: StoredRun) -> _Settings:
    """Return settings of a run; the defaults if it did not start, or has settings of another form."""
    try:
        return msgspec.convert(json.loads(run.settings or "{}"), _Settings)
    except (ValueError, RecursionError):
        return _Settings()


def as_table(runs: Iterable[StoredRun]) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the names of all columns in order of appearance, and the rows.

    A row has the status of a run, its axes (`vary.NAME`), then the columns of `RunResult.to_dict`.
    """
    rows = [
        {
            "key": run.key,
            "number": run.number,
            "status": run.status,
            "error": run.error,
            "command": run.command,
            "seconds": run.wall_s,
            **{f"vary.{name}": value for name, value in run.point.items()},
            "scenario": run.scenario,
            "run": run.run,
            "seed": run.seed,
            **run.result,
        }
        for run in runs
    ]
    return list(dict.fromkeys(name for row in rows for name in row)), rows


def read_results(*stores: str | os.PathLike[str]) -> Any:
    """Return the runs of one or several stores or folders of results as a pandas DataFrame, one row per run.

    Raise SettingError if a file is not a store, or without pandas.
    """
    pandas = optional_import("pandas", "tables")
    paths = [path_argument(store, "stores", "paths, each as an argument") for store in stores]
    names, rows = as_table(stored_runs(paths))
    return pandas.DataFrame(rows, columns=names)


def write_csv(runs: Iterable[StoredRun], path: Path) -> None:
    """Write the runs as a CSV file. Raise SettingError if it cannot be written."""
    names, rows = as_table(runs)
    with write_atomically(path) as file, io.TextIOWrapper(file, encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(map(neutralize_formula, names))
        for row in rows:
            values = [row.get(name) for name in names]
            writer.writerow([neutralize_formula(value) if isinstance(value, str) else value for value in values])


def write_parquet(runs: Iterable[StoredRun], path: Path) -> None:
    """Write the runs as a Parquet file. Columns with texts and numbers become texts.

    Raise SettingError if it cannot be written, or without pyarrow.
    """
    arrow, parquet = optional_import("pyarrow", "tables"), optional_import("pyarrow.parquet", "tables")
    names, rows = as_table(runs)
    columns = {name: _one_type([row.get(name) for row in rows]) for name in names}
    with write_atomically(path) as stream:
        parquet.write_table(arrow.table(columns), stream)


def _one_type(values: list[Any]) -> list[Any]:
    """Return the values of a column with one type: numbers, truth values or texts; None stays."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) < 2:
        return values
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]
