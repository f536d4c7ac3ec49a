"""The conflict rule, instant by instant."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.planning.conflict_area import ConflictAreaPlanner, ConflictAreaSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec

EGO = EgoState(0.0, np.zeros(3), 0.0, 0.0, 0.0, 8.0, 0.0, 0.0)
SEEN_IN, SEEN_OUT = (30.0, 7.0), (30.0, 12.0)


def planner(car: ActorSpec, **settings: object) -> ConflictAreaPlanner:
    own = ConflictAreaSettings.model_validate({"conflict_area": [29, 32, 4.5, 10.5], **settings})
    return ConflictAreaPlanner(AgentSettings(target_speed=8.0, planner_settings=own), car, None, dt=0.05, seed=0)


def objects(time: float, *places: tuple[float, float], kind: str = "car") -> Detections:
    count = len(places)
    boxes = np.array([(x, y, 0.7, 4.9, 1.8, 1.5, 0.0) for x, y in places]).reshape(count, 7)
    nothing = np.full((count, 2), np.nan)
    return Detections(time, boxes, np.ones(count), (kind,) * count, nothing, np.full((count, 2, 2), np.nan))


def braking_ticks(rule: ConflictAreaPlanner, sightings: set[int], ticks: int = 80) -> list[int]:
    found = []
    for tick in range(ticks):
        now = tick * 0.05
        known = objects(now, SEEN_OUT, SEEN_IN if tick in sightings else SEEN_OUT)
        if rule.plan(EGO, known, None, now).braking is not None:
            found.append(tick)
    return found


def test_braking_lasts_1_05_s_after_the_last_detection(car: ActorSpec) -> None:
    """Seen at 0.50 s only: 0.50 to 1.50 s, 21 ticks of 0.05 s, as the paper's 35 of 0.03 s."""
    assert braking_ticks(planner(car), {10}) == list(range(10, 31))


def test_each_detection_restarts_the_hold_time(car: ActorSpec) -> None:
    assert braking_ticks(planner(car), {10, 11, 12, 28}) == list(range(10, 49))
    assert braking_ticks(planner(car), {10, 40}) == [*range(10, 31), *range(40, 61)]


def test_no_detection_no_braking_and_immediate_braking_in_first_tick(car: ActorSpec) -> None:
    assert braking_ticks(planner(car), set()) == []
    assert braking_ticks(planner(car), {0}) == list(range(21))


@pytest.mark.parametrize(("hold", "last"), [(0.0, 10), (0.05, 10), (0.1, 11), (0.3, 15), (2.0, 49)])
def test_conflict_hold_time_sets_duration_of_braking(car: ActorSpec, hold: float, last: int) -> None:
    assert braking_ticks(planner(car, conflict_hold_time=hold), {10}) == list(range(10, last + 1))


def test_braking_plan_keeps_points_and_states_reason(car: ActorSpec) -> None:
    rule = planner(car, conflict_deceleration=4.0)
    free = rule.plan(EGO, objects(0.0, SEEN_OUT), None, 0.0)
    braked = rule.plan(EGO, objects(0.05, SEEN_OUT, SEEN_IN, kind="truck"), None, 0.05)
    held = rule.plan(EGO, objects(0.1), None, 0.1)
    assert free.braking is None
    assert braked.braking == held.braking == 4.0
    assert braked.reason == "truck in the conflict area"
    assert held.reason == "an object was in the conflict area"
    np.testing.assert_array_equal(braked.points, free.points)
    np.testing.assert_array_equal(braked.speeds, free.speeds)


def test_object_is_in_area_by_its_center(car: ActorSpec) -> None:
    """A car whose center is 0.1 m outside reaches 2.3 m into the area, and is not in it."""
    assert planner(car).plan(EGO, objects(0.0, (28.9, 7.0)), None, 0.0).braking is None
    assert planner(car).plan(EGO, objects(0.0, (29.1, 7.0)), None, 0.0).braking == 5.0


def test_object_in_any_of_several_areas_brakes(car: ActorSpec) -> None:
    rule = planner(car, conflict_area=[[29, 32, 4.5, 10.5], [[0, 0], [10, 0], [0, 10]]])
    assert rule.plan(EGO, objects(0.0, (4.0, 4.0)), None, 0.0).braking is not None
    rule = planner(car, conflict_area=[[0, 0], [10, 0], [0, 10]])
    assert rule.plan(EGO, objects(0.0, (6.0, 6.0)), None, 0.0).braking is None


def test_planner_without_area_raises_setting_error(car: ActorSpec) -> None:
    with pytest.raises(SettingError, match="setting 'conflict_area' is missing"):
        ConflictAreaPlanner(AgentSettings(), car, None, dt=0.05, seed=0)


def test_planner_is_registered_by_entry_point() -> None:
    assert registry("planners").load("conflict_area") is ConflictAreaPlanner


def test_object_below_min_existence_does_not_brake(car: ActorSpec) -> None:
    """Existence counts where it is estimated, else the score; 0.5 by default."""

    def brakes(existence: float | None, score: float = 1.0, **settings: object) -> bool:
        known = replace(objects(0.0, SEEN_IN), scores=np.array([score]))
        if existence is not None:
            known = replace(known, existence=np.array([existence]))
        return planner(car, **settings).plan(EGO, known, None, 0.0).braking is not None

    assert not brakes(0.4)
    assert brakes(0.6)
    assert brakes(0.6, score=0.1), "the existence is what counts"
    assert not brakes(None, score=0.4)
    assert brakes(0.4, min_existence=0.3)
    assert not brakes(0.9, min_existence=0.95)
    assert not brakes(math.nan)


def test_plan_names_the_objects_that_it_brakes_for(car: ActorSpec) -> None:
    known = replace(objects(0.0, SEEN_IN, SEEN_OUT, SEEN_IN, SEEN_IN), existence=np.array([0.2, 1.0, 0.9, 0.7]))
    rule = planner(car)
    assert rule.plan(EGO, known, None, 0.0).objects == (2, 3)
    assert rule.plan(EGO, objects(0.05), None, 0.05).objects == ()
