"""Jobs of a sweep: one run each, with a key that depends on its inputs only."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from eidrive_scenario.base.content_digest import canonical_json, sha256_of
from eidrive_scenario.errors import ConstraintError, Diagnostic, InputError, SettingError, counted, suggestion
from eidrive_scenario.experiments.sweeps.axes import (
    CHANNEL,
    PARAMETER,
    RUN,
    SETTINGS,
    Axis,
    Point,
    Scalar,
    is_setting,
    settings_at,
    without_run,
)
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario import ConcreteRun, load_distribution
from eidrive_scenario.run_options import diagnostic_with_option_names
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings, plain
from eidrive_scenario.simulation.result import typed
from eidrive_scenario.v2x.profile import load_profile

MOST_TRIED = 100
"""Maximum number of points that are tried to find a valid run with a value."""
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
Contents = Mapping[tuple[str, Scalar], str]
"""Digests of the inputs with one value, by axis and value, and with the texts of one run of a distribution."""


def digest_of(scenario: Path, resolved: ResolvedSettings) -> str:
    """Return the digest of the file of a scenario or distribution, and of the inputs among resolved settings."""
    inputs = resolved.as_json()
    content = {name: inputs[name] for name in _INPUTS}
    content |= {"file": sha256_of(scenario.read_bytes()), "code": list(map(_code, resolved.extensions.values()))}
    return sha256_of(canonical_json(content).encode())


def _code(extension: str) -> str:
    """Return the digest of the module of an extension, named by its package and entry point; empty if unknown."""
    module = sys.modules.get(extension.rpartition("(")[2].partition(":")[0])
    file = getattr(module, "__file__", None)
    return sha256_of(Path(file).read_bytes()) if file is not None and is_regular_file(Path(file)) else ""


def first_resolved(scenario: Path, points: Sequence[Point], settings: RunSettings) -> ResolvedSettings:
    """Return the resolved settings without a point, or of the first point if constraints exclude this run.

    Without a point, so that the digest of the inputs does not depend on the order of the points.
    """
    try:
        return _resolved(scenario, points[0].get(RUN), settings)
    except ConstraintError as error:
        excluded = error
    for point in points:
        try:
            return _resolved(scenario, point.get(RUN), settings_at(_without_channel_keys(point), settings, None))
        except ConstraintError as error:
            excluded = error
    raise excluded


def contents_of(scenario: Path, points: Sequence[Point], settings: RunSettings) -> Contents:
    """Return the digest of the inputs of a run with each text of a setting or parameter, as texts may name files.

    Build these runs, and those with the least and the greatest of the numbers of a setting, to find invalid values.
    Raise InputError for an invalid value of a setting; one of a parameter concerns its own runs only.
    """
    contents: dict[tuple[str, Scalar], str] = {}
    for name in dict.fromkeys(name for point in points for name in without_run(point)):
        values = dict.fromkeys(point[name] for point in points if name in point)
        texts = [value for value in values if isinstance(value, str)]
        numbers = [value for value in values if not isinstance(value, str)]
        try:
            for number in [min(numbers), max(numbers)] if numbers and name in SETTINGS else []:
                with suppress(ConstraintError):
                    _resolved(scenario, points[0].get(RUN), settings_at({name: number}, settings, None))
            for text in () if name.startswith(f"{CHANNEL}.") else texts:
                digest = _digest_with(name, text, scenario, points, settings)
                if digest is not None:
                    contents[name, text] = digest
        except InputError as error:
            at = {name: f"--vary: {name}"}
            raise type(error)([diagnostic_with_option_names(each, at) for each in error.diagnostics]) from error
    if RUN in points[0]:
        contents |= _contents_of_runs(scenario, dict.fromkeys(int(point[RUN]) for point in points), settings)
    return contents


def _digest_with(name: str, value: str, scenario: Path, points: Sequence[Point], settings: RunSettings) -> str | None:
    """Return the digest of the inputs with one value of an axis; None if no tried run with it is valid.

    The value alone, so that the digest does not depend on the order of the points. Other values follow where this run
    is excluded by constraints, or where the value requires others, as a fusion method requires a detector.
    """
    same = [point for point in points if point.get(name) == value][:MOST_TRIED]
    tried: Iterator[Point] = (
        {key: given for key, given in point.items() if key == name or not is_setting(key)} for point in same
    )
    whole = ({**_without_channel_keys(point), **_run_of(point)} for point in same)
    invalid: InputError | None = None
    for point in ({name: value, **_run_of(points[0])}, *tried, *whole):
        try:
            return digest_of(
                scenario, _resolved(scenario, point.get(RUN), settings_at(without_run(point), settings, None))
            )
        except ConstraintError:
            continue
        except InputError as error:
            invalid = invalid or error
    if invalid is not None and is_setting(name):
        raise invalid
    return None


def _contents_of_runs(scenario: Path, runs: Iterable[int], settings: RunSettings) -> Contents:
    """Return the digest of the inputs of each run of a distribution whose parameters have texts, by `run` and number.

    The inputs with each text are those of the first valid run with it.
    """
    expansion = load_distribution(scenario)
    texts = {}
    for number in runs:
        named = tuple(item for item in expansion[number].parameters.items() if isinstance(typed(item[1]), str))
        if named:
            texts[number] = named
    with_text: dict[tuple[str, str], list[int]] = {}
    for number, named in texts.items():
        for parameter in named:
            tried = with_text.setdefault(parameter, [])
            if len(tried) < MOST_TRIED:
                tried.append(number)
    digests = {parameter: _first_valid(scenario, numbers, settings) for parameter, numbers in with_text.items()}
    return {
        (RUN, number): sha256_of(canonical_json([digests[parameter] for parameter in named]).encode())
        for number, named in texts.items()
    }


def _first_valid(scenario: Path, runs: Sequence[int], settings: RunSettings) -> str:
    """Return the digest of the inputs of the first valid run of a distribution among these; empty without one."""
    for number in runs:
        with suppress(InputError):
            return digest_of(scenario, _resolved(scenario, number, settings))
    return ""


def _run_of(point: Point) -> Point:
    return {RUN: point[RUN]} if RUN in point else {}


def _without_channel_keys(point: Point) -> Point:
    return {name: value for name, value in without_run(point).items() if not name.startswith(f"{CHANNEL}.")}


def _resolved(scenario: Path, run: Scalar | None, settings: RunSettings) -> ResolvedSettings:
    source = scenario if run is None else load_distribution(scenario)[int(run)]
    with Simulation(source, settings=settings) as simulation:
        return simulation.resolved


MOST_RUNS = 10_000_000
"""Maximum number of runs of a sweep."""
GREATEST_SEED = 2**63 - 1
"""Greatest integer of a column of SQLite."""


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
    contents  the same digest with one text of an axis, or with the texts of a run of a distribution; these name files
    """

    scenario: Path
    points: tuple[Point, ...]
    seeds: Sequence[int]
    runs: int
    settings: RunSettings
    inputs: str
    profile: Mapping[str, Any] | None
    contents: Contents

    def __len__(self) -> int:
        return self.runs

    def __iter__(self) -> Iterator[SweepJob]:
        pairs = ((point, seed) for seed in self.seeds for point in self.points)
        return (self.job(number, *pair) for number, pair in enumerate(islice(pairs, self.runs)))

    def job(self, number: int, point: Point, seed: int) -> SweepJob:
        """Return a run at a point, which need not be one of the plan."""
        settings = settings_at(without_run(point), self.settings, self.profile)
        run = int(point[RUN]) if RUN in point else None
        contents = {name: digest for name in point if (digest := self.contents.get((name, point[name]))) is not None}
        inputs = {"inputs": self.inputs, "contents": contents}
        content = {**inputs, "run": run, "seed": seed, "settings": plain(asdict(settings))}
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
    space: Sequence[Axis] = (),
    is_distribution: bool = False,
) -> SweepPlan:
    """Return the plan of a sweep.

    The first run that its constraints do not exclude is built, not executed, to find errors that concern all runs.

    seeds  seeds of each combination; None: 1, or as many from 1 on as `runs` requires
    runs   number of runs; None: every combination with every seed
    space  axes whose values a search selects

    Raise InputError for an invalid scenario or setting, and ConstraintError if all runs are excluded.
    """
    probes = _with_space(points, space)
    _check_names_of_runs(scenario, probes, settings, is_distribution)
    count = len(points)
    if is_distribution:
        numbers = range(len(load_distribution(scenario)))
        _check_total(len(numbers) * len(points))  # before the list of them
        points, probes = (
            [{RUN: number, **point} for number in numbers for point in several] for several in (points, probes)
        )
    if runs is not None and seeds is None:
        _check_total(runs)  # before the range of as many seeds
    chosen = _seeds(len(points), None if seeds is None else list(seeds), runs)
    total = len(points) * len(chosen)
    _check_total(total)
    first = first_resolved(scenario, probes, settings)
    profile = first.channel_profile
    _check_names(probes, first.parameters)
    contents = contents_of(scenario, probes, settings)
    runs = min(total, runs or total)
    plan = SweepPlan(scenario, tuple(points), chosen, runs, settings, digest_of(scenario, first), profile, contents)
    for point in probes:  # a point that cannot be run is an error before the runs, not among them
        at = settings_at(without_run(point), settings, profile)
        if isinstance(at.channel, Mapping):
            load_profile(at.channel, origin="--vary: channel")
    different: dict[str, Point] = {}
    for point in plan.points[:count]:  # of the first run of a distribution
        same = different.setdefault(plan.job(0, point, chosen[0]).key, point)
        if same is not point:
            texts = (", ".join(f"{name}={value}" for name, value in without_run(at).items()) for at in (same, point))
            raise SettingError(Diagnostic(f"--vary: {' and '.join(texts)} are the same run", "give one of them"))
    return plan


def _check_total(total: int) -> None:
    """Raise SettingError for a number of runs that a sweep does not have."""
    if not 0 < total <= MOST_RUNS:
        raise SettingError(Diagnostic(f"the sweep has {total} runs", f"expected 1 to {MOST_RUNS}"))


def _with_space(points: Sequence[Point], space: Sequence[Axis]) -> Sequence[Point]:
    """Return the points of a search that have each value of a list, and both ends of an interval, once."""
    if not space:
        return points
    start = {axis.name: axis.at(0.0) for axis in space}
    ends = [(axis.name, value) for axis in space for value in axis.values or axis.ends]
    return [{**point, **start, name: value} for point in points for name, value in ends]


def _check_names_of_runs(scenario: Path, points: Sequence[Point], settings: RunSettings, is_distribution: bool) -> None:
    """Raise SettingError if an axis has the name of the runs of a distribution, or of a parameter of all runs.

    So does an axis or a setting of all runs with the name of a parameter that the distribution varies.
    """
    names = dict.fromkeys(name for point in points for name in point)
    for name in names:
        parameter = name.removeprefix(PARAMETER)
        if not is_setting(name) and parameter in settings.parameters:
            text = f"RunSettings.parameters: --vary varies parameter {parameter!r}"
            raise SettingError(Diagnostic(text, "remove the option"))
    if RUN in names:
        hint = f"give {PARAMETER}{RUN} for a parameter of this name; all runs of a distribution are executed"
        raise SettingError(Diagnostic(f"--vary: {RUN!r} is the number of a run of a distribution", hint))
    given = dict.fromkeys(settings.parameters, "RunSettings.parameters")
    given |= {name.removeprefix(PARAMETER): "--vary" for name in names if not is_setting(name)}
    for name, element in load_distribution(scenario).varied.names.items() if is_distribution else ():
        if name in given:
            text = f"{given[name]}: the distribution varies parameter {name!r}"
            raise SettingError(Diagnostic.at(element, text, "remove the option"))


def _check_names(points: Sequence[Point], declared: Iterable[str]) -> None:
    """Raise SettingError if an axis is neither a setting nor a declared parameter."""
    for name in dict.fromkeys(name for point in points for name in without_run(point)):
        parameter = name.removeprefix(PARAMETER)
        if not is_setting(name) and parameter not in declared:
            text = f"--vary: unknown parameter or setting {parameter!r}"
            raise SettingError(Diagnostic(text, suggestion(parameter, [*declared, *SETTINGS, "--seeds"])))


def _seeds(points: int, seeds: list[int] | None, runs: int | None) -> Sequence[int]:
    if seeds is not None:
        if len(set(seeds)) < len(seeds):
            raise SettingError(Diagnostic("--seeds: a seed is given twice", "give each seed once"))
        if any(abs(seed) > GREATEST_SEED for seed in seeds):
            raise SettingError(Diagnostic("--seeds: a seed is beyond the integers of a store", "give at most 2^63 - 1"))
        if runs is not None and runs > points * len(seeds):
            hint = f"the sweep has {counted(points, 'combination')} with {counted(len(seeds), 'seed')}"
            raise SettingError(Diagnostic(f"--runs is {runs}", hint))
        return seeds
    return range(1, 1 + (-(-runs // points) if runs is not None and points else 1))


def source_of(job: SweepJob) -> Path | ConcreteRun:
    """Return what a job runs: a scenario, or one run of a distribution."""
    return job.scenario if job.run is None else load_distribution(job.scenario)[job.run]
