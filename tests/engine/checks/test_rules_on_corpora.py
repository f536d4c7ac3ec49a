"""Rules on third-party files: every diagnostic was examined by hand, so that there are no false positives."""

from collections import Counter
from collections.abc import Iterator

import pytest
from corpora import corpora_folder, corpora_name, needs_corpora, scenario_files

from eidrive_scenario.checks.scenario_checks import run_rules
from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario

pytestmark = needs_corpora

FREQUENT = {"unused-parameter", "unused-catalog", "no-stop-trigger"}
"""Rules that many files violate: copied declarations, and empty stop triggers of 1.0."""

AT_TIME_0 = "time = 0 is true at the first evaluation of the act, so there is no rising edge"
AFTER_TIME_0 = "its act starts after time 0, so time > 0 is true at the first evaluation of the event"
EDGES_APART = "the edges of one group occur one after the other"
NO_WIDTH = "two lanes of SampleDatabase.xodr, of type none, have no <width>"
CONTACT = "a connection of junction 7 names the end of road 148, whose start is where road 170 ends"
SAMPLES = ("DoubleLaneChanger", "FastOvertakeWithReInitialization", "Overtaker", "SimpleOvertake", "TrafficJam")
EXAMINED = {
    **{
        f"asam-{v}/{name}.xosc": {"lane-width": NO_WIDTH, "geometry-gap": CONTACT}
        for v in ("1.2.0", "1.3.1")
        for name in SAMPLES
    },
    "alks/concrete_scenarios/alks_scenario_4_4_1_cut_in_no_collision_template.xosc": {
        "zero-rate-transition": "the template's own value of the rate is 0"
    },
    "alks/concrete_scenarios/alks_scenario_4_4_2_cut_in_unavoidable_collision_template.xosc": {
        "zero-rate-transition": "the template's own value of the rate is 0"
    },
    "esmini/xosc/cut-in_cr.xosc": {
        "impossible-state": "it waits for the end of a continuous LaneOffsetAction, which by the standard has none"
    },
    "esmini/xosc/parking_demo.xosc": {
        "lane-link": "a driving lane 12 m wide, for parking, ends at a junction",
        "object-off-road": "trees at s = 210 m of a road of 200 m, parking spaces at 31.3 m of one of 30.1 m",
    },
    "esmini/xosc/ltap-od-relative-speed.xosc": {"s-out-of-range": "s = 455 on a road of 304 m"},
    "scenario_runner/CatalogExample.xosc": {"simultaneous-edges": EDGES_APART, "unobserved-edge": AFTER_TIME_0},
    "scenario_runner/CyclistCrossing.xosc": {"simultaneous-edges": EDGES_APART},
    "scenario_runner/FollowLeadingVehicle.xosc": {"unobserved-edge": AT_TIME_0},
    "scenario_runner/InitAddEntityAction.xosc": {"simultaneous-edges": EDGES_APART},
    "scenario_runner/InitDeleteEntityAction.xosc": {
        "simultaneous-edges": EDGES_APART,
        "entity-without-position": "two adversaries are deleted in Init, and never placed",
    },
    "scenario_runner/LaneChangeSimple.xosc": {"unobserved-edge": AT_TIME_0},
    "scenario_runner/LaneOffsetActionExample.xosc": {"unobserved-edge": AT_TIME_0},
    "scenario_runner/OscControllerExample.xosc": {"unobserved-edge": AT_TIME_0},
    "scenario_runner/PedestrianCrossingFront.xosc": {"simultaneous-edges": EDGES_APART},
    "scenario_runner/Slalom.xosc": {"unobserved-edge": "the act starts after 120 s and is to stop as these pass"},
    "scenario_runner/StoryAddEntityAction.xosc": {"simultaneous-edges": EDGES_APART},
    "scenario_runner/StoryDeleteEntityAction.xosc": {"simultaneous-edges": EDGES_APART},
    "scenario_runner/VehicleLateralDistance.xosc": {"unobserved-edge": AT_TIME_0},
}


@pytest.fixture(scope="module")
def maps() -> Iterator[None]:
    """Set the folder of the maps of ScenarioRunner."""
    patch = pytest.MonkeyPatch()
    patch.setenv("EIDRIVE_MAPS", f"{corpora_folder()}/carla_towns")
    yield
    patch.undo()


@pytest.fixture(scope="module")
def found(maps: None) -> dict[str, Counter[str]]:
    """Return the number of violations of each rule by file."""
    counts: dict[str, Counter[str]] = {}
    for path in scenario_files():
        if "<Storyboard" not in path.read_text(encoding="utf-8", errors="replace"):
            continue
        try:
            scenario = load_scenario(path)
        except ScenarioError:
            continue
        rules = Counter(diagnostic.rule for _, diagnostic in run_rules(scenario))
        counts[corpora_name(path)] = rules
    return counts


@pytest.mark.exhaustive
def test_corpora_diagnostics_equal_the_examined_ones(found: dict[str, Counter[str]]) -> None:
    relevant = {path: set(rules) - FREQUENT for path, rules in found.items()}
    assert {path: rules for path, rules in relevant.items() if rules} == {
        path: set(rules) for path, rules in EXAMINED.items()
    }


def test_corpora_most_files_violate_no_important_rule(found: dict[str, Counter[str]]) -> None:
    assert len(found) > 110
    total = sum(found.values(), Counter())
    assert total["no-stop-trigger"] == sum("no-stop-trigger" in rules for rules in found.values())
    assert sum(not (set(rules) - FREQUENT - {"lane-width", "geometry-gap"}) for rules in found.values()) > 100
