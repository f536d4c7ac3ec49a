"""The marker `scenario` and the fixture `run_scenario`, for tests written in Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Protocol

import pytest

from eidrive_scenario.errors import ExtensionError, InputError, SimulationError, WallLimitError, suggestion
from eidrive_scenario.library import definition, library_path, resolve_scenario
from eidrive_scenario.pytest_plugin.options import RunVariant, arms
from eidrive_scenario.pytest_plugin.outcome import explain, properties, run_variant

if TYPE_CHECKING:
    from eidrive_scenario.openscenario import Source
    from eidrive_scenario.simulation import RunResult

_KEYWORDS = ("channel", "seeds")


@dataclass(frozen=True)
class Case:
    """What the marker asks the test to run."""

    source: Path
    arm: RunVariant


class RunScenario(Protocol):
    """What the fixture gives."""

    def __call__(
        self,
        source: Source | None = None,
        *,
        channel: str | None = None,
        seed: int | None = None,
        **settings: object,
    ) -> RunResult: ...


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize tests that are marked with `scenario` over scenarios, channels and seeds."""
    marker = metafunc.definition.get_closest_marker("scenario")
    if marker is None:
        return
    if "run_scenario" not in metafunc.fixturenames:
        if marker in metafunc.definition.own_markers:
            message = "it has the marker scenario, and does not take the fixture run_scenario, which plays it"
            raise pytest.fail.Exception(f"{metafunc.definition.nodeid}: {message}", pytrace=False)
        return
    try:
        if sum(own.name == marker.name for own in metafunc.definition.own_markers) > 1:
            raise ValueError('it has several markers scenario; give one all patterns: scenario("a.xosc", "b.xosc")')
        channels, seeds = _read_marker(marker)
        paths = [path for pattern in marker.args for path in _matches(pattern, metafunc)]
    except ValueError as error:
        raise pytest.fail.Exception(f"{metafunc.definition.nodeid}: {error}", pytrace=False) from None
    cases = [Case(path, arm) for path in paths for arm in arms(metafunc.config, channels, seeds)]
    metafunc.parametrize("run_scenario", cases, indirect=True, ids=[f"{case.source.stem}-{case.arm}" for case in cases])


def _read_marker(marker: pytest.Mark) -> tuple[Sequence[str] | None, int | None]:
    """Channels and number of seeds. Raise ValueError for what the marker does not take."""
    if not marker.args or not all(isinstance(pattern, str | Path) for pattern in marker.args):
        raise ValueError('the marker scenario needs a pattern, such as scenario("coop/*.xosc")')
    for keyword in marker.kwargs:
        if keyword not in _KEYWORDS:
            raise ValueError(f"the marker scenario takes no {keyword!r}; {suggestion(keyword, _KEYWORDS)}")
    channel, seeds = marker.kwargs.get("channel"), marker.kwargs.get("seeds")
    channels = [channel] if isinstance(channel, str) else channel
    if channels is not None and not (
        isinstance(channels, list | tuple) and channels and all(isinstance(name, str) for name in channels)
    ):
        raise ValueError(f'channel is {channel!r}; give a name or a list of names: channel=["ideal", "none"]')
    if seeds is not None and (not isinstance(seeds, int) or isinstance(seeds, bool) or seeds < 1):
        raise ValueError(f"seeds is {seeds!r}; say how many, to run with the seeds from 1 on: seeds=3")
    return channels, seeds


def _matches(pattern: str | Path, metafunc: pytest.Metafunc) -> list[Path]:
    """Scenarios beside the test file, else below the root, else in the library; a pattern without suffix is a name.

    Raise ValueError if there is none.
    """
    glob = str(pattern) if str(pattern).endswith(".xosc") else f"{pattern}.xosc"
    if not Path(glob).is_absolute():
        for folder in (metafunc.definition.path.parent, metafunc.config.rootpath, library_path()):
            found = sorted(path for path in folder.glob(glob) if definition(path) in ("scenario", "unreadable"))
            if found:
                return found
    elif Path(glob).is_file():
        return [Path(glob)]
    raise ValueError(f"no scenario matches {str(pattern)!r}, beside the test file, below the root or in the library")


@pytest.fixture
def run_scenario(request: pytest.FixtureRequest) -> RunScenario:
    """A function that plays a scenario and gives its RunResult; the numbers go into the test report.

    In a test with the marker `scenario` it is called without arguments. Any other scenario is played by
    `run_scenario("coop/scenario_1", channel="none", seed=3)`; further keywords are fields of RunSettings. In place of a
    name it takes what load_scenario takes, as a Scenario of scenariogeneration.

    The run is part of the test, which may expect its errors: `pytest.raises(WallLimitError)`. So an aborted run is a
    failure of the test, where a `.xosc` file as a test item has an error. A wrong input fails the test with file and
    line.
    """
    case: Case | None = getattr(request, "param", None)

    def run(
        source: Source | None = None, *, channel: str | None = None, seed: int | None = None, **settings: object
    ) -> RunResult:
        __tracebackhide__ = True  # a failure shows the line of the test that called it
        source = case.source if source is None and case is not None else source
        if source is None:
            pytest.fail('name a scenario: run_scenario("coop/scenario_1"), or use the marker scenario', pytrace=False)
        arm = case.arm if case is not None else RunVariant(None, 1)
        replaced = arm.replaced if channel is None and seed is None else ()
        arm = RunVariant(arm.channel if channel is None else channel, arm.seed if seed is None else seed, replaced)
        try:
            source = resolve_scenario(source) if isinstance(source, str | Path) else source
            result = run_variant(request.node, source, arm, **settings)
        except InputError as error:
            raise pytest.fail.Exception(str(error), pytrace=False) from None
        except SimulationError as error:
            place = error.place if isinstance(error, ExtensionError | WallLimitError) else None
            if error.__cause__ is not None and place is not None:
                error.__cause__.__traceback__ = _from_file(error.__cause__.__traceback__, place.file)
            raise error.with_traceback(None) from error.__cause__
        result = replace(result, warnings=(*result.warnings, *arm.replaced))
        request.node.user_properties.extend(properties(result))
        if not result.passed:
            request.node.add_report_section("call", "eidrive", explain(result))
        return result

    return run


def _from_file(trace: TracebackType | None, file: str) -> TracebackType | None:
    """The part of a traceback that begins in a file; all of it if none does."""
    part = trace
    while part is not None and part.tb_frame.f_code.co_filename != file:
        part = part.tb_next
    return part or trace
