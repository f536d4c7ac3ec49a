"""Jobs of a sweep: one run each, with a key that depends on its inputs only."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import ConstraintError, Diagnostic, SettingError, suggestion
from eidrive_scenario.experiments.sweeps.axes import (
    CHANNEL,
    PARAMETER,
    SETTINGS,
    Point,
    Scalar,
    is_setting,
    settings_at,
)
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario import ConcreteRun, load_distribution
from eidrive_scenario.resolved_settings import ResolvedSettings, canonical_json, package_versions, sha256_of
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.v2x.profile import load_profile

MOST_RUNS = 10_000_000
"""Maximum number of runs of a sweep."""
RUN = "run"
"""Name of the axis of the runs of a distribution file."""
_INPUTS = (
    "files",
    "versions",
    "extensions",
    "channel_profile",
    "later_channels",
    "stations",
    "weather_profile",
    "criteria",
)
"""Resolved settings that determine results beside the settings of a run, which may only name their files."""


@dataclass(frozen=True)
class SweepJob:
    """Run of a sweep.

    key       digest of the inputs
    number    position in the sweep, from 0
    scenario  file of the scenario or of the distribution
    run       number among the runs of a distribution; None for a scenario
    point     values of the axes
    """

    key: str
    number: int
    scenario: Path
    run: int | None
    seed: int
    point: Point
    settings: RunSettings


@dataclass(frozen=True)
class SweepPlan:
    """All runs of a sweep, created one by one in the order of their seeds.

    scenario  file of the scenario or of the distribution
    points    combinations of the values of the axes; the axis `run` is the number of a run of a distribution
    seeds     seeds of each combination
    runs      maximum number of runs; with fewer than all, every combination gets the first seeds
    settings  settings of all runs
    inputs    digest of all input files, of what they contain, and of versions
    profile   channel profile whose settings the axes `channel.KEY` replace
    contents  the same digest with one setting, by its axis and value, as these values may name files
    """

    scenario: Path
    points: tuple[Point, ...]
    seeds: Sequence[int]
    runs: int
    settings: RunSettings
    inputs: str
    profile: Mapping[str, Any] | None
    contents: Mapping[tuple[str, Scalar], str]

    def __len__(self) -> int:
        return self.runs

    def __iter__(self) -> Iterator[SweepJob]:
        return islice(self._jobs(), self.runs)

    def _jobs(self) -> Iterator[SweepJob]:
        number = 0
        for seed in self.seeds:
            for point in self.points:
                yield self.job(number, point, seed)
                number += 1

    def job(self, number: int, point: Point, seed: int) -> SweepJob:
        """Return a run at a point, which need not be one of the plan."""
        settings = settings_at(_without_run(point), self.settings, self.profile)
        run = int(point[RUN]) if RUN in point else None
        contents = {name: found for name in point if (found := self.contents.get((name, point[name]))) is not None}
        inputs = {"inputs": self.inputs, "contents": contents}
        content = {**inputs, "run": run, "seed": seed, "settings": _plain(settings)}
        return SweepJob(sha256_of(canonical_json(content).encode()), number, self.scenario, run, seed, point, settings)


@dataclass(frozen=True)
class Shard:
    """Part of a plan for one job of a job array: every `count`-th run from the `number`-th on, from 1."""

    plan: SweepPlan
    number: int = 1
    count: int = 1

    def __len__(self) -> int:
        return len(range(self.number - 1, len(self.plan), self.count))

    def __iter__(self) -> Iterator[SweepJob]:
        return islice(self.plan, self.number - 1, None, self.count)


def plan_of(
    scenario: Path,
    points: Sequence[Point],
    settings: RunSettings,
    *,
    seeds: Iterable[int] | None = None,
    runs: int | None = None,
    is_distribution: bool = False,
) -> SweepPlan:
    """Return the plan of a sweep.

    The first run that its constraints do not exclude is built, not executed, to find errors that concern all runs.

    seeds  seeds of each combination; None: 1, or as many from 1 on as `runs` requires
    runs   number of runs; None: every combination with every seed

    Raise InputError for an invalid scenario or setting, and ConstraintError if all runs are excluded.
    """
    if is_distribution:
        points = [{RUN: number, **point} for number in range(len(load_distribution(scenario))) for point in points]
    chosen = _seeds(len(points), None if seeds is None else list(seeds), runs)
    total = len(points) * len(chosen)
    if not 0 < total <= MOST_RUNS:
        raise SettingError(Diagnostic(f"the sweep has {total} runs", f"expected 1 to {MOST_RUNS}"))
    first = _first_resolved(scenario, points, settings)
    profile = first.channel_profile
    _check_names(points, first.parameters)
    contents = _contents(scenario, points, settings)
    runs = min(total, runs or total)
    plan = SweepPlan(scenario, tuple(points), chosen, runs, settings, _digest(scenario, first), profile, contents)
    for point in points:  # a point that cannot be run is an error before the runs, not among them
        at = settings_at(_without_run(point), settings, profile)
        if isinstance(at.channel, Mapping):
            load_profile(at.channel, origin="--vary: channel")
    return plan


def _check_names(points: Sequence[Point], declared: Iterable[str]) -> None:
    """Raise SettingError if an axis is neither a setting nor a declared parameter."""
    for name in dict.fromkeys(name for point in points for name in _without_run(point)):
        parameter = name.removeprefix(PARAMETER)
        if not is_setting(name) and parameter not in declared:
            text = f"--vary: unknown parameter or setting {parameter!r}"
            raise SettingError(Diagnostic(text, suggestion(parameter, [*declared, *sorted(SETTINGS)])))


def _contents(scenario: Path, points: Sequence[Point], settings: RunSettings) -> dict[tuple[str, Scalar], str]:
    """Return the digest of the inputs of a run with each text of a setting, by name and value.

    Build these runs, and those with the least and the greatest of the numbers of a setting, to find invalid values.
    Raise InputError for an invalid one.
    """
    found: dict[tuple[str, Scalar], str] = {}
    for name in SETTINGS:
        values = dict.fromkeys(point[name] for point in points if name in point)
        numbers = [value for value in values if not isinstance(value, str)]
        texts: list[Scalar] = [value for value in values if isinstance(value, str)]
        for value in texts + ([min(numbers), max(numbers)] if numbers else []):
            with suppress(ConstraintError):
                resolved = _resolved(scenario, points[0].get(RUN), settings_at({name: value}, settings, None))
                if isinstance(value, str):
                    found[name, value] = _digest(scenario, resolved)
    return found


def _digest(scenario: Path, resolved: ResolvedSettings) -> str:
    """Return the digest of the file of a scenario or distribution, and of the inputs among resolved settings."""
    inputs = resolved.as_json()
    content = {name: inputs[name] for name in _INPUTS}
    content |= {"file": sha256_of(scenario.read_bytes()), "code": [_code(one) for one in resolved.extensions.values()]}
    return sha256_of(canonical_json(content).encode())


def _code(extension: str) -> str:
    """Return the digest of the module of an extension, named by its package and entry point; empty if unknown."""
    module = sys.modules.get(extension.rpartition("(")[2].partition(":")[0])
    file = getattr(module, "__file__", None)
    return sha256_of(Path(file).read_bytes()) if file is not None and is_regular_file(Path(file)) else ""


def versions() -> Mapping[str, str]:
    """Return the versions of the packages that affect results."""
    return package_versions()


def _seeds(points: int, seeds: list[int] | None, runs: int | None) -> Sequence[int]:
    if seeds is not None:
        if len(set(seeds)) < len(seeds):
            raise SettingError(Diagnostic("--seeds: a seed is given twice", "give each seed once"))
        if runs is not None and runs > points * len(seeds):
            hint = f"there are {points} combinations with {len(seeds)} seeds"
            raise SettingError(Diagnostic(f"--runs is {runs}", hint))
        return seeds
    return range(1, 1 + (-(-runs // points) if runs is not None and points else 1))


def _first_resolved(scenario: Path, points: Sequence[Point], settings: RunSettings) -> ResolvedSettings:
    """Return the resolved settings without a point, or of the first point if constraints exclude this run.

    Without a point, so that the digest of the inputs does not depend on the order of the points.
    """
    try:
        return _resolved(scenario, points[0].get(RUN), settings)
    except ConstraintError as error:
        excluded = error
    for point in points:
        chosen = {name: value for name, value in _without_run(point).items() if not name.startswith(f"{CHANNEL}.")}
        try:
            return _resolved(scenario, point.get(RUN), settings_at(chosen, settings, None))
        except ConstraintError as error:
            excluded = error
    raise excluded


def _without_run(point: Point) -> Point:
    return {name: value for name, value in point.items() if name != RUN}


def _resolved(scenario: Path, run: Scalar | None, settings: RunSettings) -> ResolvedSettings:
    source = scenario if run is None else load_distribution(scenario)[int(run)]
    with Simulation(source, settings=settings) as simulation:
        return simulation.resolved


def source_of(job: SweepJob) -> Path | ConcreteRun:
    """Return what a job runs: a scenario, or one run of a distribution."""
    return job.scenario if job.run is None else load_distribution(job.scenario)[job.run]


def _plain(settings: RunSettings) -> dict[str, Any]:
    return {name: _text(value) for name, value in asdict(settings).items()}


def _text(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _text(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_text(item) for item in value]
    return value if value is None or isinstance(value, str | int | float | bool) else str(value)
