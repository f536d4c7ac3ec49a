"""Tests of traffic lights and stop lines."""

from __future__ import annotations

import pytest
from fleet_scene import add_car, car, street
from opendrive_xml import lane_links_xml, lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import Fleet

FRONT = 1.4 + 0.5 * 4.6
"""Distance from the reference point to the front bumper [m]."""


def light(
    s: float = 200.0, orientation: str = "+", validity: str = "", dynamic: str = "yes", kind: int = 1000001
) -> str:
    return (
        f'<signals><signal id="7" s="{s}" t="-9" dynamic="{dynamic}" orientation="{orientation}" type="{kind}" '
        f'zOffset="3" name="light">{validity}</signal></signals>'
    )


class Lights:
    """State of all lights, and the lights that were requested."""

    def __init__(self, red: bool = True) -> None:
        self.red = red
        self.asked: set[str] = set()

    def __call__(self, signal: str) -> bool:
        self.asked.add(signal)
        return self.red


def approaching(roads: RoadNetwork, lights: Lights, *, lane: int = -1, at: float = 60.0) -> Fleet:
    fleet = Fleet(roads, must_stop=lights)
    add_car(fleet, car("me"), roads.location("1", lane, at), speed=14.0, desired_speed=14.0)
    return fleet


def test_car_waits_at_red_light_until_green() -> None:
    """The car stops 1 m before the line plus the standstill gap of 2 m."""
    lights = Lights()
    fleet = approaching(street(right=1, extra=light()), lights)
    for _ in range(800):
        place = fleet.step(None, 0.05)["me"]
    assert lights.asked == {"7"}
    assert place.speed == pytest.approx(0.0, abs=0.05)
    assert 200.0 - (place.x + FRONT) - 1.0 == pytest.approx(2.0, abs=0.3)
    lights.red = False
    for _ in range(300):
        place = fleet.step(None, 0.05)["me"]
    assert place.x > 250.0


def test_following_car_stops_behind_waiting_car() -> None:
    roads = street(right=1, extra=light())
    fleet = approaching(roads, Lights())
    add_car(fleet, car("next"), roads.location("1", -1, 30.0), speed=14.0, desired_speed=14.0)
    for _ in range(800):
        places = fleet.step(None, 0.05)
    assert places["me"].x - places["next"].x - 4.6 == pytest.approx(2.0, abs=0.3)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("orientation", "validity", "lane", "stops"),
    [
        ("+", "", -1, True),
        ("-", "", -1, False),
        ("none", "", -1, True),
        ("-", "", 1, True),
        ("+", "", 1, False),
        ("+", '<validity fromLane="-2" toLane="-2"/>', -1, False),
        ("+", '<validity fromLane="-2" toLane="-1"/>', -1, True),
    ],
)
def test_light_stops_cars_on_its_valid_lanes_only(orientation: str, validity: str, lane: int, stops: bool) -> None:
    roads = street(1, 2, extra=light(500.0, orientation, validity), mark="none")
    fleet = approaching(roads, Lights(), lane=lane, at=460.0 - 60.0 if lane < 0 else 600.0)
    for _ in range(700):
        place = fleet.step(None, 0.05)["me"]
    assert (place.speed < 0.05) is stops


@pytest.mark.parametrize(("dynamic", "kind"), [("no", 1000001), ("yes", 1000002), ("yes", 1000013)])
def test_static_signal_does_not_stop_cars(dynamic: str, kind: int) -> None:
    """Types 1000002 and 1000013 of the OpenDRIVE catalog are lights for pedestrians and cyclists."""
    lights = Lights()
    fleet = approaching(street(right=1, extra=light(dynamic=dynamic, kind=kind)), lights)
    for _ in range(300):
        place = fleet.step(None, 0.05)["me"]
    assert not lights.asked
    assert place.x > 240.0


@pytest.mark.parametrize(("distance", "stops"), [(25.5, True), (23.5, False)])
def test_car_that_cannot_brake_comfortably_passes_red_light(distance: float, stops: bool) -> None:
    """From 14 m/s, braking with 4 m/s² takes 24.5 m."""
    fleet = approaching(street(right=1, extra=light()), Lights(), at=200.0 - FRONT - distance)
    for _ in range(300):
        place = fleet.step(None, 0.05)["me"]
    assert (place.x < 200.0 - FRONT) is stops


def test_car_standing_on_stop_line_continues() -> None:
    """The line is 0.5 m into the second road. The car stands on the first road with its front beyond the line."""
    lanes = [section_xml(right=lane_xml(-1, link=link)) for link in (lane_links_xml(after=-1), lane_links_xml(-1))]
    first = road_xml("1", link=successor_xml("2"), lanes=lanes[0])
    second = road_xml("2", x=100.0, link=predecessor_xml("1"), lanes=lanes[1], extra=light(0.5))
    roads = RoadNetwork.parse(map_xml(first, second))
    fleet = Fleet(roads, must_stop=Lights())
    add_car(fleet, car("me"), roads.location("1", -1, 98.0))
    for _ in range(100):
        place = fleet.step(None, 0.05)["me"]
    assert place.x > 102.0


def test_red_light_holds_car_before_junction_until_green(library_roads: RoadNetwork) -> None:
    lights = Lights()
    fleet = Fleet(library_roads, must_stop=lights)
    start = library_roads.location("3", 1, 70.0)
    add_car(fleet, car("me"), start, speed=8.0)
    for _ in range(600):
        place = fleet.step(None, 0.05)["me"]
    assert lights.asked == {"10", "20", "30", "40"}
    assert place.speed < 0.05
    stands = library_roads.locate_at(place.x, place.y)
    assert stands is not None
    assert stands.road == "3"
    lights.red = False
    for _ in range(900):
        fleet.step(None, 0.05)
    assert "me" not in fleet


def test_driver_that_ignores_lights_does_not_stop() -> None:
    roads = street(right=1, extra=light())
    fleet = Fleet(roads, must_stop=Lights())
    row, progress = fleet.lanes.of(roads.location("1", -1, 60.0))
    fleet.add_at(car("me"), row, progress, speed=14.0, desired_speed=14.0, ignores_lights=True)
    for _ in range(300):
        place = fleet.step(None, 0.05)["me"]
    assert place.x == pytest.approx(60.0 + 14.0 * 15.0, abs=2.0)
