"""Tests of the lanes for which signals are valid, and of the direction of their faces."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml

from eidrive_scenario.perception.traffic_lights import stop_lines
from eidrive_scenario.roads import RoadNetwork


def street(orientation: str, validity: str, *, reference: str = "", h_offset: float = 0.0) -> RoadNetwork:
    """Return a street with one lane per direction and signal 7 at s = 50 m; lane -1 drives along s."""
    signal = (
        f'<signal id="7" s="50" t="-5" dynamic="yes" orientation="{orientation}" type="1000001" hOffset="{h_offset}" '
        f'zOffset="3" name="light">{validity}</signal>{reference}'
    )
    return RoadNetwork.parse(map_xml(road_xml(lanes=lanes_xml(1, 1), extra=f"<signals>{signal}</signals>")))


def valid(lane: int) -> str:
    return f'<validity fromLane="{lane}" toLane="{lane}"/>'


@pytest.mark.parametrize(
    ("orientation", "validity", "lanes"),
    [
        ("+", "", (-1,)),
        ("-", "", (1,)),
        ("none", "", (1, -1)),
        ("+", '<validity fromLane="-1" toLane="1"/>', (-1,)),
        ("none", valid(1), (1,)),
        ("+", valid(1), (1,)),
        ("+", valid(0), ()),
    ],
)
def test_signal_is_valid_for_lanes_of_validity_and_orientation(
    orientation: str, validity: str, lanes: tuple[int, ...]
) -> None:
    """A validity for lanes of the other direction only takes precedence over the orientation."""
    roads = street(orientation, validity)
    assert roads.signal_lanes(roads.signals["7"].place) == lanes
    assert len(stop_lines(roads)) == len(lanes)


@pytest.mark.parametrize(("orientation", "h_offset"), [("+", math.pi), ("-", 0.0), ("+", 0.0), ("-", math.pi)])
def test_face_of_a_signal_by_references_is_turned_against_their_traffic(orientation: str, h_offset: float) -> None:
    """As in CARLA's maps: the signal itself is valid for no lane, its reference for lane -1, which drives along s."""
    reference = f'<signalReference id="7" s="50" t="0" orientation="-">{valid(-1)}</signalReference>'
    roads = street(orientation, valid(0), reference=reference, h_offset=h_offset)
    assert math.cos(roads.signal_pose(roads.signals["7"]).h) == pytest.approx(-1.0)


def test_face_of_a_signal_with_own_lanes_follows_its_orientation() -> None:
    reference = f'<signalReference id="7" s="50" t="0" orientation="-">{valid(1)}</signalReference>'
    roads = street("+", "", reference=reference)
    assert math.cos(roads.signal_pose(roads.signals["7"]).h) == pytest.approx(-1.0)


@pytest.mark.parametrize(("place", "line"), [(97.0, 97.0), (80.0, 100.0), (103.0, 100.0)])
def test_stop_line_is_before_a_light_that_stands_right_before_the_junction(place: float, line: float) -> None:
    """Road 1 leads along x into a junction at 100 m; the light stands at `place` and is valid on connecting road 2."""
    inside = f'<signalReference id="7" s="0" t="0" orientation="+">{valid(-1)}</signalReference>'
    light = f'<signal id="7" s="{place}" t="-5" dynamic="yes" orientation="+" type="1000001">{valid(0)}</signal>'
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("1", length=110.0, extra=f"<signals>{light}</signals>"),
            road_xml("2", length=20.0, x=100.0, junction="9", extra=f"<signals>{inside}</signals>"),
        )
    )
    (found,) = stop_lines(roads)
    assert found.x == pytest.approx(line)
    assert found.y == pytest.approx(-1.75)
