"""Digests of the inputs of the runs of a sweep: of all files that they read, and of what these contain."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path

from eidrive_scenario.errors import ConstraintError, InputError
from eidrive_scenario.experiments.sweeps.axes import (
    CHANNEL,
    SETTINGS,
    Point,
    Scalar,
    is_number,
    is_setting,
    settings_at,
)
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario import load_distribution
from eidrive_scenario.resolved_settings import ResolvedSettings, canonical_json, sha256_of
from eidrive_scenario.simulation import RunSettings, Simulation

RUN = "run"
"""Name of the axis of the runs of a distribution file."""
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
    content |= {"file": sha256_of(scenario.read_bytes()), "code": [_code(one) for one in resolved.extensions.values()]}
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
    found: dict[tuple[str, Scalar], str] = {}
    for name in dict.fromkeys(name for point in points for name in without_run(point)):
        values = dict.fromkeys(point[name] for point in points if name in point)
        texts = [value for value in values if isinstance(value, str)]
        numbers = [value for value in values if not isinstance(value, str)]
        if name in SETTINGS:
            for number in [min(numbers), max(numbers)] if numbers else []:
                with suppress(ConstraintError):
                    _resolved(scenario, points[0].get(RUN), settings_at({name: number}, settings, None))
        for text in () if name.startswith(f"{CHANNEL}.") else texts:
            digest = _digest_with(name, text, scenario, points, settings)
            if digest is not None:
                found[name, text] = digest
    if RUN in points[0]:
        found |= _contents_of_runs(scenario, dict.fromkeys(int(point[RUN]) for point in points), settings)
    return found


def _digest_with(name: str, value: str, scenario: Path, points: Sequence[Point], settings: RunSettings) -> str | None:
    """Return the digest of the inputs with one value of an axis; None if no tried run with it is valid.

    The value alone, so that the digest does not depend on the order of the points. Other values follow where this run
    is excluded by constraints, or where the value of a parameter requires others.
    """
    same = (point for point in points if point.get(name) == value)
    tried: Iterator[Point] = (
        {key: given for key, given in point.items() if key == name or not is_setting(key)} for point in same
    )
    for point in ({name: value, **_run_of(points[0])}, *islice(tried, MOST_TRIED)):
        try:
            return digest_of(
                scenario, _resolved(scenario, point.get(RUN), settings_at(without_run(point), settings, None))
            )
        except ConstraintError:
            continue
        except InputError:
            if is_setting(name):
                raise
    return None


def _contents_of_runs(scenario: Path, runs: Iterable[int], settings: RunSettings) -> Contents:
    """Return the digest of the inputs of each run of a distribution whose parameters have texts, by `run` and number.

    The inputs with each text are those of the first valid run with it.
    """
    expansion = load_distribution(scenario)
    texts = {}
    for number in runs:
        named = tuple(one for one in expansion[number].parameters.items() if not is_number(one[1]))
        if named:
            texts[number] = named
    with_text: dict[tuple[str, str], list[int]] = {}
    for number, named in texts.items():
        for one in named:
            tried = with_text.setdefault(one, [])
            if len(tried) < MOST_TRIED:
                tried.append(number)
    digests = {one: _first_valid(scenario, numbers, settings) for one, numbers in with_text.items()}
    return {
        (RUN, number): sha256_of(canonical_json([digests[one] for one in named]).encode())
        for number, named in texts.items()
    }


def _first_valid(scenario: Path, runs: Sequence[int], settings: RunSettings) -> str:
    """Return the digest of the inputs of the first valid run of a distribution among these; empty without one."""
    for number in runs:
        with suppress(InputError):
            return digest_of(scenario, _resolved(scenario, number, settings))
    return ""


def without_run(point: Point) -> Point:
    """Return a point without the number of a run of a distribution."""
    return {name: value for name, value in point.items() if name != RUN}


def _run_of(point: Point) -> Point:
    return {RUN: point[RUN]} if RUN in point else {}


def _without_channel_keys(point: Point) -> Point:
    return {name: value for name, value in without_run(point).items() if not name.startswith(f"{CHANNEL}.")}


def _resolved(scenario: Path, run: Scalar | None, settings: RunSettings) -> ResolvedSettings:
    source = scenario if run is None else load_distribution(scenario)[int(run)]
    with Simulation(source, settings=settings) as simulation:
        return simulation.resolved
