"""Runs of third-party scenarios to their stop trigger, their end or the time limit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from corpora import CORPORA, corpora_folder, corpora_name, needs_corpora, scenario_files
from lxml import etree
from reference_traces import END, comparable, source_of

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation

pytestmark = needs_corpora

ENDS = {"stop trigger", "storyboard complete", "time limit"}
BROKEN = {
    "esmini/xosc/car_walk.xosc": "its catalogs are those of another repository, at an absolute path",
}
"""Scenarios that cannot be run, with the reason."""
SMALLEST = {"esmini": 65, "alks": 15, "asam-1.2.0": 13, "asam-1.3.1": 14, "scenario_runner": 16}
"""Minimum number of scenarios of each corpus."""


def scenarios() -> list[str]:
    """Return the files with a storyboard; the others are catalogs and distributions."""
    found = []
    for path in scenario_files():
        root = etree.parse(path, etree.XMLParser(recover=True)).getroot()
        if root is not None and root.find("Storyboard") is not None:
            found.append(corpora_name(path))
    return found or ["none"]


def compared() -> set[str]:
    """Return the files whose runs `test_reference_agreement` compares with those of esmini."""
    return {corpora_name(source_of(CORPORA, name)) for name in comparable(CORPORA)} if CORPORA else set()


class PresenceObserver:
    """Observer of the actors of a run and of the validity of their positions."""

    def __init__(self) -> None:
        self.seen: set[str] = set()
        self.frames = 0

    def observe(self, frame: Frame) -> None:
        self.frames += 1
        self.seen.update(frame.view.names)
        assert np.isfinite(frame.view.position).all()
        assert np.isfinite(frame.view.speed).all()

    def close(self) -> None:
        pass


@pytest.fixture(autouse=True)
def maps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EIDRIVE_MAPS", str(corpora_folder() / "carla_towns"))


@pytest.mark.exhaustive
@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", sorted({*scenarios()} - {*BROKEN} - compared()))
@pytest.mark.filterwarnings("default")
def test_corpora_scenario_runs_to_its_end(name: str, record_property: Callable[[str, object], None]) -> None:
    scenario, watch = load_scenario(corpora_folder() / name), PresenceObserver()
    settings = RunSettings(dt=0.05, time_limit=60.0)
    result = Simulation(scenario, settings=settings, observers=[watch]).run()
    record_property(END, f"{name}: {result.end_reason} at {result.simulated_s:.2f} s")
    assert result.end_reason in ENDS
    assert watch.frames > 1
    placed = {private.entity_ref for private in scenario.storyboard.init.actions.private if _placed(private)}
    assert placed & set(scenario.entities) <= watch.seen


def _placed(private: object) -> bool:
    actions = getattr(private, "private_action", ())
    return any(action.teleport_action is not None for action in actions)


@pytest.mark.parametrize("name", BROKEN)
def test_corpora_invalid_scenario_has_expected_error(name: str, record_property: Callable[[str, object], None]) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(corpora_folder() / name)
    assert all(diagnostic.line for diagnostic in caught.value.diagnostics)
    record_property(END, f"{name}: refused, as {BROKEN[name]} at line {caught.value.diagnostics[0].line}")


def test_corpora_scenarios_are_all_covered() -> None:
    names = scenarios()
    for corpus, least in SMALLEST.items():
        assert sum(name.startswith(f"{corpus}/") for name in names) >= least
    assert set(BROKEN) <= set(names)


@pytest.mark.parametrize(
    ("name", "entity", "lane"),
    [
        ("LaneChangeSimple", "hero", ("48", 4)),
        ("Slalom", "hero", ("24", 1)),
        ("CyclistCrossing", "hero", ("9", 1)),
        ("LaneOffsetActionExample", "hero", ("4", -1)),
    ],
)
def test_carla_scenarios_start_on_lanes_in_driving_direction(name: str, entity: str, lane: tuple[str, int]) -> None:
    """Their world positions have the left-handed axes of CARLA; with y to the left they are outside of the town."""
    scenario = load_scenario(corpora_folder() / "scenario_runner" / f"{name}.xosc")
    with Simulation(scenario, settings=RunSettings(dt=0.05)) as simulation:
        simulation.tick()
        stage = simulation.storyboard.context
        here = stage.location(entity)
        assert here is not None
        assert (here.road, here.lane) == lane
        assert abs(here.offset) < 0.6
        assert abs(stage.actors[entity].motion.heading) < 0.05
