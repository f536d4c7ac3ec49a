"""Criterion `collision`: actors, time, position and speed of contacts."""

import math
from pathlib import Path
from typing import Any

import pytest
from eidrive_criteria.collision import Collision, CollisionSettings
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.api.common import Contact
from eidrive_scenario.api.criteria import evaluate_criteria
from eidrive_scenario.roads import RoadNetwork


def criterion(**settings: Any) -> Collision:
    return Collision(CollisionSettings.model_validate({"of": "Ego", **settings}))


def test_collision_first_contact_is_the_verdict(frame: Any, car: Any) -> None:
    cars = {"Incoming": car(0), "Ego": car(9)}
    touch = Contact("Incoming", "Ego", (29.84, 7.06, 0.5), 11.24)
    frames = [frame(0.0, cars), frame(6.35, cars, [touch]), frame(6.4, cars, [Contact("Ego", "Wall", (0, 0, 0), 1.0)])]
    collision = criterion()
    (verdict,) = evaluate_criteria(frames, [collision])
    assert not verdict.passed
    assert (verdict.value, verdict.limit, verdict.first_violation) == (2.0, 0.0, 6.35)
    assert verdict.reason == (
        "Ego and Incoming hit each other at 6.35 s at (29.8, 7.1) m at a relative speed of 11.2 m/s; "
        "Ego with its left, not at fault as it had stopped"
    )
    assert collision.metrics() == {
        "collision.count": 2.0,
        "collision.time": 6.35,
        "collision.impact_speed": 11.24,
        "collision.at_fault": 0.0,
    }


@pytest.mark.parametrize(("others", "passed"), [(None, False), ("Bus", False), ("Van", True), (["Van", "Bus"], False)])
def test_collision_with_restricts_the_actors(frame: Any, car: Any, others: Any, passed: bool) -> None:
    cars = {"Ego": car(0), "Bus": car(5), "Van": car(9)}
    (verdict,) = evaluate_criteria(
        [frame(1.0, cars, [Contact("Ego", "Bus", (0, 0, 0), 1.0)])], [criterion(**{"with": others})]
    )
    assert verdict.passed is passed


def test_collision_of_other_actors_is_ignored(frame: Any, car: Any) -> None:
    cars = {"Ego": car(0), "Bus": car(5), "Van": car(9)}
    (verdict,) = evaluate_criteria([frame(1.0, cars, [Contact("Van", "Bus", (0, 0, 0), 1.0)])], [criterion()])
    assert verdict.passed
    assert verdict.reason == "Ego touched nothing"


@pytest.mark.parametrize("settings", [{"of": "Eg0"}, {"with": "Incoming"}, {"with": ["Bus", "Incoming"]}])
def test_collision_of_absent_actor_fails(frame: Any, car: Any, settings: dict[str, Any]) -> None:
    (verdict,) = evaluate_criteria([frame(0.0, {"Ego": car(0), "Bus": car(9)})], [criterion(**settings)])
    assert not verdict.passed
    assert "never present" in verdict.reason


def test_collision_is_fatal_at_contact_only(frame: Any, car: Any) -> None:
    criterion_under_test = criterion(**{"with": "Incoming", "fatal": True})
    (waiting,) = evaluate_criteria([frame(0.0, {"Ego": car(0)})], [criterion_under_test])
    cars = {"Ego": car(0), "Incoming": car(9)}
    (hit,) = evaluate_criteria([frame(1.0, cars, [Contact("Ego", "Incoming", (0, 0, 0), 1.0)])], [criterion_under_test])
    assert (waiting.passed, waiting.fatal, hit.passed, hit.fatal) == (False, False, False, True)


def test_collision_actor_may_be_added_later(frame: Any, car: Any) -> None:
    frames = [frame(0.0, {"Ego": car(0)}), frame(1.0, {"Ego": car(0), "Incoming": car(9)}), frame(2.0, {"Ego": car(0)})]
    (verdict,) = evaluate_criteria(frames, [criterion(**{"with": "Incoming"})])
    assert verdict.passed


@pytest.mark.parametrize(
    ("speed", "other", "point", "side", "at_fault"),
    [
        (0.0, (4.0, 0.0, 0.0, -5.0), (2, 0), "front", False),  # standing
        (5.0, (4.0, 0.0, 0.0, 0.0), (2, 0), "front", True),  # into a standing car
        (5.0, (4.0, 0.5, 0.0, 3.0), (2, 0.5), "front", True),  # into a slower car
        (5.0, (-4.0, 0.0, 0.0, 9.0), (-2, 0), "rear", False),  # hit from behind
        (5.0, (0.0, 2.0, 0.0, 9.0), (0.5, 1), "left", False),  # at the side, without roads
        (5.0, (0.0, -2.0, 0.0, 9.0), (0.5, -1), "right", False),
        (5.0, (4.0, 0.1, 0.0, 3.0), (2.03, 0.99), "front", True),  # into a slower car, with a corner
        (5.0, (3.9, 1.99, 0.0, 3.0), (1.97, 0.99), "left", False),  # along the side of a slower car
        (-5.0, (-4.0, 0.0, 0.0, -3.0), (-2, 0), "rear", True),  # reverse into a slower car
        (-5.0, (-4.0, 0.0, 90.0, 1.0), (-2, 0), "rear", True),  # reverse into a crossing car
        (-5.0, (4.0, 0.0, 0.0, -9.0), (2, 0), "front", False),  # hit at the front by a faster car
        (-5.0, (0.0, 2.0, 0.0, 9.0), (0.5, 1), "left", False),  # at the side
    ],
)
def test_collision_side_and_fault_by_the_rules_of_nuplan(
    frame: Any, car: Any, speed: float, other: Any, point: Any, side: str, at_fault: bool
) -> None:
    cars = {"Ego": car(0, speed=speed), "Bus": car(*other)}
    frames = [frame(0.0, cars), frame(0.05, cars, [Contact("Bus", "Ego", (*point, 0.5), 5.0)])]
    collision = criterion()
    (verdict,) = evaluate_criteria(frames, [collision])
    assert f"Ego with its {side}, {'at fault' if at_fault else 'not at fault'} as" in verdict.reason
    assert collision.metrics()["collision.at_fault"] == at_fault
    (only,) = evaluate_criteria(frames, [criterion(only_at_fault=True)])
    assert (only.passed, only.value) == (not at_fault, float(at_fault))


@pytest.mark.parametrize(("y", "at_fault"), [(0.0, False), (1.2, True), (-5.0, True)])
def test_collision_at_the_side_is_a_fault_outside_one_lane(
    frame: Any, car: Any, roads: Any, y: float, at_fault: bool
) -> None:
    """The lane has a width of 3.5 m around y = 0, parking and shoulder begin at -1.75 m."""
    cars = {"Ego": car(-50, y, speed=5.0), "Bus": car(-50, y + 2.0, speed=9.0)}
    collision = criterion()
    evaluate_criteria([frame(0.0, cars, [Contact("Ego", "Bus", (-50, y + 1.0, 0), 1.0)])], [collision], roads)
    assert collision.metrics()["collision.at_fault"] == at_fault


def test_collision_speeds_before_the_contact_count(frame: Any, car: Any) -> None:
    """The crash itself stops the Ego."""
    before = {"Ego": car(0, speed=9.0), "Bus": car(4.1, speed=2.0)}
    after = {"Ego": car(0.1, speed=0.0), "Bus": car(4.1, speed=6.0)}
    collision = criterion()
    evaluate_criteria([frame(0.0, before), frame(0.05, after, [Contact("Ego", "Bus", (2.1, 0, 0), 7.0)])], [collision])
    assert collision.metrics()["collision.at_fault"] == 1.0


def test_collision_with_a_wall_is_a_fault(frame: Any, car: Any) -> None:
    """A wall is no actor of the view."""
    collision = criterion()
    evaluate_criteria([frame(0.0, {"Ego": car(0, speed=5.0)}, [Contact("Ego", "Wall", (2, 0, 0), 5.0)])], [collision])
    assert collision.metrics()["collision.at_fault"] == 1.0


@pytest.mark.parametrize(
    ("own_speed", "place", "heading", "speed", "side"),
    [
        (0.1, (4.0, 0.0), 180.0, 5.0, "front"),
        (0.1, (-4.0, 0.0), 0.0, 5.0, "rear"),
        (0.1, (0.0, 2.4), -90.0, 3.0, "left"),
        (0.1, (0.0, -2.4), 90.0, 3.0, "right"),
        (1.0, (3.75, 2.3), -90.0, 8.0, "front"),
        (8.0, (3.75, 2.3), -90.0, 1.0, "left"),
    ],
)
def test_side_of_a_corner_contact_is_that_of_the_approach(
    frame: Any, car: Any, own_speed: float, place: tuple[float, float], heading: float, speed: float, side: str
) -> None:
    # Faces that touch are reported by a corner, which lies on two faces. The bodies are 4.5 m by 1.8 m and 2 m by 2 m.
    # In the last two cases the gaps are 0.5 m and 0.4 m: the side is that of the gap which closes last.
    sizes = {"Ego": (4.5, 1.8, 1.5), "Other": (2.0, 2.0, 1.5)}
    cars = {"Ego": car(0.0, speed=own_speed), "Other": car(*place, math.radians(heading), speed)}
    touch = Contact("Ego", "Other", (2.25, 0.9, 0.5), 5.0)
    frames = [frame(0.0, cars, sizes=sizes), frame(0.05, cars, [touch], sizes=sizes)]
    (verdict,) = evaluate_criteria(frames, [criterion()])
    assert f"Ego with its {side}," in verdict.reason


@pytest.mark.parametrize(
    ("x", "y", "yaw", "place"),
    [
        (-50.0, 0.0, 0.0, None),  # in its lane
        (-50.0, -3.5, 0.0, None),  # parked at the roadside
        (-50.0, 3.5, math.pi, None),  # in the lane beside, in its direction
        (36.5, 1.5, 0.5, None),  # turning in the junction, over lanes of all directions
        (-50.0, 1.0, 0.0, "in a lane of the opposite direction"),  # partly
        (-50.0, 3.5, 0.0, "in a lane of the opposite direction"),
        (14.0, 0.0, 0.0, None),  # before the crosswalk, from x = 16.2 m on
        (15.0, 0.0, 0.0, "on a crosswalk"),  # partly
    ],
)
def test_stopped_actor_is_at_fault_where_it_must_not_stop(
    frame: Any, car: Any, roads: Any, x: float, y: float, yaw: float, place: str | None
) -> None:
    """The lane has a width of 3.5 m around y = 0, the opposite one around 3.5 m."""
    cars = {"Ego": car(x, y, yaw), "Bus": car(x + 4.0, y, yaw + math.pi, 9.0)}
    collision = criterion()
    frames = [frame(0.0, cars), frame(0.05, cars, [Contact("Ego", "Bus", (x + 2.0, y, 0.5), 9.0)])]
    (verdict,) = evaluate_criteria(frames, [collision], roads)
    assert collision.metrics()["collision.at_fault"] == (place is not None)
    assert f"as it had stopped{'' if place is None else f' {place}'}" in verdict.reason


def test_collision_of_an_actor_that_stopped_on_rails_is_a_fault(frame: Any, car: Any, tmp_path: Path) -> None:
    path = tmp_path / "tram.xodr"
    path.write_text(
        map_xml(road_xml("1", length=100.0, lanes=section_xml(right=lane_xml(-1) + lane_xml(-2, kind="tram")))),
        encoding="utf-8",
    )
    for y, fault in ((-1.75, 0.0), (-3.0, 1.0)):
        cars = {"Ego": car(50.0, y), "Tram": car(58.0, y, math.pi, 9.0)}
        collision = criterion()
        frames = [frame(0.0, cars), frame(0.05, cars, [Contact("Ego", "Tram", (52.0, y, 0.5), 9.0)])]
        evaluate_criteria(frames, [collision], RoadNetwork.load(path))
        assert collision.metrics()["collision.at_fault"] == fault
