"""Marker `scenario` and fixture `run_scenario` for tests in Python."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

import pytest

from eidrive_scenario.errors import ExtensionError, InputError, SimulationError, WallLimitError, suggestion
from eidrive_scenario.extensions.library import definition, library_path, resolve_scenario
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.failures import (
    add_error,
    add_failures,
    add_section,
    explain_outcome,
)
from eidrive_scenario.pytest_plugin.markers import distinct_test_names, keywords, run_markers
from eidrive_scenario.pytest_plugin.option_values import path_beside
from eidrive_scenario.pytest_plugin.outcome import run_and_report
from eidrive_scenario.pytest_plugin.variants import MarkerSettings, RunVariant, run_variants

if TYPE_CHECKING:
    from eidrive_scenario.experiments.statistics.sequential import RatioTest
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.openscenario import Source
    from eidrive_scenario.simulation import RunResult

_KEYWORDS = ("channel", "seeds", "success_rate", "drive", "criteria")
_NAMES: Mapping[str, str] = {
    "distribution": "a parameter value distribution, whose runs are tests by `pytest FILE`",
    "catalog": "a catalog",
    "roads": "an OpenDRIVE file",
}
"""Descriptions of files that are no scenarios, by definition."""


class RunScenario(Protocol):
    """Function that the fixture returns."""

    def __call__(
        self,
        source: Source | None = None,
        *,
        channel: str | None = None,
        seed: int | None = None,
        **settings: object,
    ) -> Any: ...


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize tests over channels and seeds, and those that are marked with `scenario` also over scenarios."""
    marker = metafunc.definition.get_closest_marker("scenario")
    if marker is None:
        if "run_scenario" in metafunc.fixturenames:
            _repeat_unmarked(metafunc)
        return
    if "run_scenario" not in metafunc.fixturenames:
        if marker in metafunc.definition.own_markers:
            message = "a test with the marker scenario requires the fixture run_scenario"
            raise pytest.fail.Exception(f"{metafunc.definition.nodeid}: {message}", pytrace=False)
        return
    try:
        if sum(own.name == marker.name for own in metafunc.definition.own_markers) > 1:
            raise ValueError('several markers scenario (expected one with all patterns: scenario("a.xosc", "b.xosc"))')
        channels, seeds = _read_marker(marker)
        rate = _read_rate(marker)
        added = _added(marker, metafunc.definition.path.parent)
        paths = [path for pattern in marker.args for path in _matches(pattern, metafunc)]
    except ValueError as error:
        raise pytest.fail.Exception(f"{metafunc.definition.nodeid}: {error}", pytrace=False) from None
    variants = list(run_variants(metafunc.config, channels, seeds, added, rate))
    config = metafunc.config
    names = distinct_test_names(config, paths)
    cases = [
        pytest.param(
            (path, variant),
            id=f"{names[path]}-{variant}",
            marks=tuple(run_markers(config, path, variant.selectors, None)),
        )
        for path in paths
        for variant in variants
    ]
    metafunc.parametrize("run_scenario", cases, indirect=True)


def _repeat_unmarked(metafunc: pytest.Metafunc) -> None:
    """Parametrize a test without the marker over the channels and seeds of options.

    It gets no test of the success rate, as its calls return results of single runs.
    """
    variants = [replace(variant, rate=None) for variant in run_variants(metafunc.config)]
    if [(variant.channel, variant.seed) for variant in variants] != [(None, 1)]:
        cases = [pytest.param((None, variant), id=str(variant)) for variant in variants]
        metafunc.parametrize("run_scenario", cases, indirect=True)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Add the settings of a run of a marked test to the words of the option -k, as scenario files have them."""
    match getattr(getattr(item, "callspec", None), "params", {}).get("run_scenario"):
        case (_, RunVariant() as variant):
            item.extra_keyword_matches.update(keywords(variant.selectors, None))


def _read_marker(marker: pytest.Mark) -> tuple[Sequence[str] | None, int | None]:
    """Return channels and number of seeds. Raise ValueError for an invalid argument of the marker."""
    if not marker.args or not all(isinstance(pattern, str | Path) for pattern in marker.args):
        raise ValueError('marker scenario: no pattern (expected, for example, scenario("coop/*.xosc"))')
    for keyword in marker.kwargs:
        if keyword not in _KEYWORDS:
            raise ValueError(f"marker scenario: unknown argument {keyword!r}; {suggestion(keyword, _KEYWORDS)}")
    channel, seeds = marker.kwargs.get("channel"), marker.kwargs.get("seeds")
    channels = [channel] if isinstance(channel, str) else channel
    if channels is not None and not (
        isinstance(channels, list | tuple) and channels and all(isinstance(name, str) for name in channels)
    ):
        raise ValueError(
            f'channel: not a name or list of names (got {channel!r}; expected ["ideal", "none"] or "ideal")'
        )
    if seeds is not None and (not isinstance(seeds, int) or isinstance(seeds, bool) or seeds < 1):
        raise ValueError(f"seeds: not a positive number of seeds (got {seeds!r})")
    return channels, seeds


def _read_rate(marker: pytest.Mark) -> RatioTest | None:
    """Return the test of the success rate. Raise ValueError for another value."""
    given = marker.kwargs.get("success_rate")
    if given is None:
        return None
    from eidrive_scenario.experiments.statistics.sequential import RatioTest, success_rate

    if marker.kwargs.get("seeds") is not None:
        raise ValueError("marker scenario: seeds and success_rate exclude each other")
    if isinstance(given, RatioTest):
        return given
    if not isinstance(given, float):
        raise ValueError(f"success_rate: not a rate (got {given!r}; expected 0.9 or success_rate(at_least=0.9))")
    return success_rate(given)


def _added(marker: pytest.Mark, folder: Path) -> MarkerSettings:
    """Return driving stacks and criteria of the marker; files may be beside the test file."""
    drive, criteria = marker.kwargs.get("drive"), marker.kwargs.get("criteria")
    if isinstance(drive, Mapping):
        drive = {name: path_beside(stack, folder) for name, stack in drive.items()}
    if isinstance(criteria, list | tuple):
        criteria = [path_beside(criterion, folder) for criterion in criteria]
    return MarkerSettings(drive, path_beside(criteria, folder))


def _matches(pattern: str | Path, metafunc: pytest.Metafunc) -> list[Path]:
    """Return scenarios beside the test file, else below the root, else in the library.

    A pattern without suffix is a name. Raise ValueError if no scenario matches, or only other files.
    """
    others: list[Path] = []
    glob = str(pattern) if str(pattern).endswith(".xosc") else f"{pattern}.xosc"
    if not Path(glob).is_absolute():
        for folder in (metafunc.definition.path.parent, metafunc.config.rootpath, library_path()):
            files = sorted(folder.glob(glob))
            scenarios = [path for path in files if definition(path) in ("scenario", "unreadable")]
            if scenarios:
                return scenarios
            others += files
    elif is_regular_file(glob):
        if definition(Path(glob)) in ("scenario", "unreadable"):
            return [Path(glob)]
        others.append(Path(glob))
    if others:
        found_text = f"got {_NAMES.get(definition(others[0]), 'another file')}; expected a scenario"
        raise ValueError(f"marker scenario: {str(pattern)!r} matches {others[0]} ({found_text})")
    raise ValueError(f"no scenario matches {str(pattern)!r} beside the test file, below the root or in the library")


@pytest.fixture
def run_scenario(request: pytest.FixtureRequest) -> RunScenario:
    """Return a function that runs a scenario, adds its numbers to the test report and returns its RunResult.

    In a test with the marker `scenario` the function is called without arguments. With `success_rate` in the marker it
    runs the seeds 1, 2, 3 … and returns a RateVerdict, whose `passed` is the verdict. Other scenarios are run by
    `run_scenario("coop/scenario_1", channel="none", seed=3)`; further keywords are fields of RunSettings. Instead of a
    name, every source of load_scenario is valid, for example a Scenario of scenariogeneration.

    The run is part of the test, which may expect its errors: `pytest.raises(WallLimitError)`. An aborted run is
    therefore a failure of the test, and an error of a `.xosc` file as a test item. Invalid input fails the test with
    file and line.
    """
    marked: tuple[Path | None, RunVariant] = getattr(request, "param", (None, RunVariant(None, 1)))

    def run(
        source: Source | None = None, *, channel: str | None = None, seed: int | None = None, **settings: object
    ) -> RunResult | RateVerdict:
        __tracebackhide__ = True  # a failure shows the calling line of the test
        path, variant = marked
        source = path if source is None else source
        if source is None:
            message = 'run_scenario: no scenario (expected run_scenario("coop/scenario_1") or the marker scenario)'
            pytest.fail(message, pytrace=False)
        if channel is not None:
            settings["channel"], variant = channel, replace(variant, replaced=())
        if seed is not None:
            variant = replace(variant, seed=seed, replaced=(), rate=None)
        try:
            source = resolve_scenario(source) if isinstance(source, str | os.PathLike) else source
            result = run_and_report(request.node, source, variant, settings)
        except InputError as error:
            add_error(request.node, error, request.node.path)
            raise pytest.fail.Exception(printable(str(error)), pytrace=False) from None
        except SimulationError as error:
            add_error(request.node, error, request.node.path)
            location = error.place if isinstance(error, ExtensionError | WallLimitError) else None
            if error.__cause__ is not None and location is not None:
                error.__cause__.__traceback__ = _from_file(error.__cause__.__traceback__, location.file)
            raise error.with_traceback(None) from error.__cause__
        if not result.passed:
            add_section(request.node, explain_outcome(result))
            add_failures(request.node, result, source if isinstance(source, Path) else request.node.path)
        return result

    return run


def _from_file(trace: TracebackType | None, file: str) -> TracebackType | None:
    """Return the part of a traceback that begins in a file, or the whole traceback without that file."""
    part = trace
    while part is not None and part.tb_frame.f_code.co_filename != file:
        part = part.tb_next
    return part or trace
