"""Right of way on roads of the library, by the rules of the road."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import road_xml
from planned_drive import FRONT, KnownBox, PlannedDrive, behavior
from signal_street import CAR

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import distances_along, footprint_distance
from eidrive_scenario.driving.planning.behavior.right_of_way import JunctionRules, Passage
from eidrive_scenario.roads import RoadNetwork

ROADS = Path(__file__).parents[4] / "xosc" / "roads"

IN = {
    "four_way_junction": {"west": (-20.0, 0.0), "east": (100.0, 3.5), "south": (43.8, -60.0), "north": (40.3, 60.0)},
    "t_junction": {"west": (-20.0, 0.5), "east": (100.0, 4.0), "north": (29.8, 60.0)},
    "roundabout": {"west": (-20.0, 0.0), "circle": (39.9, 15.9)},
}
"""Places on lanes into the junctions."""
OUT = {
    "four_way_junction": {"west": (-20.0, 3.5), "east": (100.0, 0.0), "south": (40.3, -60.0), "north": (43.8, 60.0)},
    "t_junction": {"west": (-20.0, 4.0), "east": (100.0, 0.5), "north": (33.3, 60.0)},
    "roundabout": {"south": (52.3, -72.3)},
}
"""Places on lanes out of the junctions."""


@cache
def rules(name: str) -> JunctionRules:
    return JunctionRules(RoadNetwork.load(ROADS / f"{name}.xodr"))


def way(name: str, start: str, end: str) -> Array:
    roads = RoadNetwork.load(ROADS / f"{name}.xodr")
    first, last = roads.locate_at(*IN[name][start]), roads.locate_at(*OUT[name][end])
    assert first is not None
    assert last is not None
    return np.asarray(roads.route(first, last).polyline(1.0))[:, :2]


def passage(name: str, start: str, end: str) -> Passage:
    """Return the first passage of a way."""
    return rules(name).passages(way(name, start, end))[0]


def gives_way(name: str, own: str, other: str) -> bool:
    """Return whether `own` gives way to `other`, both as "from to"."""
    first, second = (passage(name, *text.split()) for text in (own, other))
    return rules(name).gives_way(first, second)


def test_passage_has_entry_and_turn() -> None:
    found = passage("four_way_junction", "west", "north")
    # The way is at x = -20 m first, the junction begins at 29 m.
    assert found.start == pytest.approx(49.0, abs=1.5)
    assert found.heading == pytest.approx(0.0, abs=0.02)
    assert found.turn == pytest.approx(math.pi / 2, abs=0.1)
    assert passage("four_way_junction", "south", "east").turn == pytest.approx(-math.pi / 2, abs=0.1)
    assert passage("four_way_junction", "east", "west").turn == pytest.approx(0.0, abs=0.02)


@cache
def rules_with_priorities() -> JunctionRules:
    """Return the rules of the four-way junction whose roads 101 to 106, from west and east, have priority."""
    text = (ROADS / "four_way_junction.xodr").read_text()
    pairs = "".join(f'<priority high="{a}" low="{b}"/>' for a in range(101, 107) for b in range(107, 113))
    return JunctionRules(RoadNetwork.parse(text.replace("</junction>", f"{pairs}</junction>")))


@pytest.mark.parametrize(
    ("own", "other", "expected"),
    [
        ("west east", "south north", False),  # against priority to the right
        ("south north", "west east", True),
        ("south west", "east north", True),
        ("west north", "east west", True),  # left turn: no priority between both
        ("south west", "north south", True),
    ],
)
def test_priorities_of_the_map_precede_priority_to_the_right(own: str, other: str, expected: bool) -> None:
    known = rules_with_priorities()
    first, second = (known.passages(way("four_way_junction", *text.split()))[0] for text in (own, other))
    assert known.gives_way(first, second) is expected
    assert known.gives_way(first._replace(gives_way=True), second)


@pytest.mark.parametrize("pair", ['high="101" low="999"', 'high="101"', ""])
def test_priority_without_roads_is_a_warning(pair: str) -> None:
    text = (ROADS / "four_way_junction.xodr").read_text()
    roads = RoadNetwork.parse(text.replace("</junction>", f"<priority {pair}/></junction>"))
    assert roads.junctions["100"].priorities == ()
    (warning,) = roads.map_warnings
    assert "<priority> of junction '100' has no effect" in str(warning)


def test_priorities_of_the_map_hold_unseen_traffic() -> None:
    known = rules_with_priorities()
    street, stem = (known.passages(way("four_way_junction", *text.split()))[0] for text in ("west east", "south north"))
    assert (street.road, stem.road) == ("101", "110")
    assert not known.may_cross(street, stem)
    assert known.may_cross(stem, street)


@pytest.mark.parametrize(
    ("own", "other", "expected"),
    [
        ("west east", "south north", True),  # from the right
        ("south north", "west east", False),
        ("west east", "north south", False),  # from the left
        ("west east", "east west", False),
        ("west north", "east west", True),  # left turn before oncoming traffic
        ("east west", "west north", False),
        ("west north", "east south", False),  # two left turns
        ("west south", "east west", False),  # right turn
        ("north west", "west east", True),
    ],
)
def test_priority_to_the_right_and_left_turns(own: str, other: str, expected: bool) -> None:
    assert gives_way("four_way_junction", own, other) == expected


def test_road_with_left_hand_traffic_elsewhere_does_not_change_right_of_way() -> None:
    text = (ROADS / "four_way_junction.xodr").read_text()
    far = road_xml("far", x=5000.0, rule="LHT")
    mixed = JunctionRules(RoadNetwork.parse(text.replace("</OpenDRIVE>", f"{far}</OpenDRIVE>")))
    east, north, turn, oncoming = (
        mixed.passages(way("four_way_junction", *ends.split()))[0]
        for ends in ("west east", "south north", "west north", "east west")
    )
    assert (mixed.gives_way(east, north), mixed.gives_way(north, east)) == (True, False)
    assert (mixed.gives_way(turn, oncoming), mixed.gives_way(oncoming, turn)) == (True, False)


@pytest.mark.parametrize(
    ("own", "other", "expected"),
    [("north east", "west east", True), ("west east", "north east", False), ("east north", "north west", False)],
)
def test_stop_sign_has_precedence_over_the_right(own: str, other: str, expected: bool) -> None:
    assert passage("t_junction", "north", "east").gives_way
    assert gives_way("t_junction", own, other) == expected


def test_entry_of_a_roundabout_gives_way_to_the_circle() -> None:
    assert passage("roundabout", "west", "south").gives_way
    assert gives_way("roundabout", "west south", "circle south")
    assert not gives_way("roundabout", "circle south", "west south")


def test_stop_sign_is_on_the_ways_that_it_controls() -> None:
    (place,) = rules("t_junction").stops_along(way("t_junction", "north", "west"))
    # From y = 60 m to the sign at s = 0.5 m of a road that begins at y = 12.8 m.
    assert place == pytest.approx(60.0 - 13.3, abs=1.0)
    assert rules("t_junction").stops_along(way("t_junction", "west", "east")) == ()


@pytest.mark.parametrize("speed", [8.0, 12.0])
@pytest.mark.parametrize("other_speed", [5.0, 8.0])
def test_vehicle_with_the_right_of_way_does_not_brake_for_oncoming_traffic(speed: float, other_speed: float) -> None:
    """A car comes towards the vehicle and drives straight on. It could turn left, but would have to give way."""
    roads = RoadNetwork.load(ROADS / "four_way_junction.xodr")
    run = PlannedDrive(behavior(roads, speed), roads, speed=speed, start=-30.0, y=0.0)
    # Both are in the middle of the junction at the same time.
    start = 42.0 + 72.0 / speed * other_speed
    run.run(100.0 / speed, lambda now: [KnownBox(start - other_speed * now, 3.5, vx=-other_speed, yaw=math.pi)])
    run.world.close()
    assert min(run.speeds) > speed - 0.1


def drive_past_a_car_from_the_right(later: float) -> tuple[PlannedDrive, float]:
    """Return a drive with 8 m/s straight over a junction, and the time at which a car from the right is in its middle:
    later than the vehicle would be [s]."""
    roads = RoadNetwork.load(ROADS / "four_way_junction.xodr")
    run = PlannedDrive(behavior(roads, 8.0), roads, speed=8.0, start=-30.0, y=0.0)
    arrival = 72.0 / 8.0 + later
    run.run(20.0, lambda now: [KnownBox(43.8, 8.0 * (now - arrival), vy=8.0, yaw=math.pi / 2.0)])
    run.world.close()
    return run, arrival


@pytest.mark.parametrize("later", [-0.75, 0.0, 0.75])
def test_vehicle_brakes_comfortably_for_traffic_from_the_right(later: float) -> None:
    """A car with the right of way drives straight on; until it is in the junction it could also turn left, across a
    nearer part of the way of the vehicle. Both would be in the middle of the junction at about the same time."""
    run, arrival = drive_past_a_car_from_the_right(later)
    speeds = np.array(run.speeds)
    assert ((speeds[:-10] - speeds[10:]) / 0.5).max() < 3.05
    # The car has left the lane before the vehicle reaches its side.
    enters = next(0.05 * number for number, (x, _, _) in enumerate(run.path) if x + FRONT > 43.8 - 0.9)
    assert 8.0 * (enters - arrival) - 2.25 > CAR.size[1] / 2.0
    # After a standstill at the entry of the junction it would be there 4.5 s behind the car: 15 m with 1.5 m/s².
    assert enters < arrival + 4.5


@pytest.mark.parametrize("later", [0.5, 0.75, 1.0])
def test_vehicle_slows_down_comfortably_instead_of_stopping(later: float) -> None:
    """A car with the right of way is in the middle of the junction somewhat later than the vehicle would be. With 40 %
    of its speed, which takes 2.4 s with 2 m/s², the vehicle passes behind it."""
    run, _ = drive_past_a_car_from_the_right(later)
    speeds = np.array(run.speeds)
    assert ((speeds[:-10] - speeds[10:]) / 0.5).max() < 2.1
    assert speeds.min() == pytest.approx(0.4 * 8.0, abs=0.15)


def test_possible_turn_of_a_late_car_causes_no_emergency_braking() -> None:
    """A car from the right with the right of way appears when the vehicle is 17 m before its way, from 10 m/s a stop
    with 2.9 m/s². If it turned left, the vehicle would have to stop earlier."""
    roads = RoadNetwork.load(ROADS / "four_way_junction.xodr")
    run = PlannedDrive(behavior(roads, 10.0), roads, speed=10.0, start=-30.0, y=0.0)
    appears = (43.8 - 1.0 - FRONT - 17.0 + 30.0) / 10.0

    def seen(now: float) -> list[KnownBox]:
        car = KnownBox(43.8, -28.0 + 10.0 * (now - appears), vy=10.0, yaw=math.pi / 2.0)
        return [car] if now >= appears else []

    run.run(20.0, seen)
    run.world.close()
    speeds = np.array(run.speeds)
    assert 2.0 < ((speeds[:-10] - speeds[10:]) / 0.5).max() < 4.05
    assert not any(reason.startswith("emergency braking") for reason in run.reasons)


@pytest.mark.parametrize("speed", [4.0, 6.0])
def test_vehicle_with_priority_stops_for_a_car_that_turns_before_it(speed: float) -> None:
    """The car begins the turn 2 s before the vehicle would enter the junction."""
    roads = RoadNetwork.load(ROADS / "four_way_junction.xodr")
    turn = way("four_way_junction", "east", "south")
    along = distances_along(turn)
    begin = float(np.interp(-55.0, -turn[:, 0], along))

    def car(now: float) -> list[KnownBox]:
        distance = begin + speed * (now - (59.0 / 8.0 - 2.0))
        (x, x_ahead), (y, y_ahead) = (
            np.interp((distance, distance + 1.0), along, values).tolist() for values in turn.T
        )
        yaw = math.atan2(y_ahead - y, x_ahead - x)
        return [KnownBox(x, y, speed * math.cos(yaw), speed * math.sin(yaw), yaw=yaw)]

    run = PlannedDrive(behavior(roads, 8.0), roads, speed=8.0, start=-30.0, y=0.0)
    run.run(14.0, car)
    run.world.close()
    gaps = [
        footprint_distance(
            (x + CAR.offset[0], y, 0.0, *CAR.size, 0.0), (other.x, other.y, 0.0, *other.size, 1.0, other.yaw)
        )
        for number, (x, y, _) in enumerate(run.path)
        for other in car(number * 0.05)
    ]
    assert min(gaps) > 0.2
    assert run.path[-1][0] > 29.0
