"""Tests of slopes with superelevation: the t-axis is rotated by heading, slope and bank, in this order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from scipy.spatial.transform import Rotation

from eidrive_scenario.roads import RoadNetwork


def lane(width: float, offset: float = 0.0) -> str:
    return f'<laneOffset s="0" a="{offset}" b="0" c="0" d="0"/>{lanes_xml(0, 1, width)}'


def profiles(elevation: str, bank: float, twist: float = 0.0) -> str:
    return (
        f'<elevationProfile><elevation s="0" {elevation}/></elevationProfile><lateralProfile>'
        f'<superelevation s="0" a="{bank}" b="{twist}" c="0" d="0"/></lateralProfile>'
    )


CLIMB = 'a="0" b="0.1" c="0" d="0"'
CREST = 'a="0" b="0" c="0.15" d="-0.005"'


@pytest.fixture
def climbing() -> RoadNetwork:
    """Slope of 10 % with a bank of 0.4 rad and one lane of 6 m, as slope_up_leaning_right of esmini."""
    return RoadNetwork.parse(map_xml(road_xml(length=50.0, lanes=lane(6.0), profiles=profiles(CLIMB, 0.4))))


@pytest.fixture
def crest() -> RoadNetwork:
    """Crest to the north with a bank of 45° and one lane centered at t = -2.5, as tilted_crest of esmini."""
    lanes, tilted = lane(3.0, -1.0), profiles(CREST, math.pi / 4)
    return RoadNetwork.parse(map_xml(road_xml(length=20.0, hdg=math.pi / 2, lanes=lanes, profiles=tilted)))


def test_lane_pose_on_banked_slope_leans_as_in_esmini(climbing: RoadNetwork, crest: RoadNetwork) -> None:
    """Expected values are from the tests of esmini 3.6.0: x = 10.116 at s = 10, and y = 1.4845 at s = 1."""
    assert climbing.lane_pose_at("1", -1, 10.0).x == pytest.approx(10.116, abs=5e-4)
    assert crest.lane_pose_at("1", -1, 1.0).y == pytest.approx(1.4845, abs=5e-5)


@pytest.mark.parametrize("s", [1.0, 7.0, 13.0])
def test_road_pose_equals_product_of_rotations(crest: RoadNetwork, s: float) -> None:
    slope = 0.3 * s - 0.015 * s * s
    turned = Rotation.from_euler("ZYX", [math.pi / 2, -math.atan(slope), math.pi / 4])
    expected = np.array([0.0, s, 0.15 * s * s - 0.005 * s**3]) + turned.apply([0.0, -2.5, 0.0])
    pose = crest.road_pose_at("1", s, -2.5)
    assert pose[:3] == pytest.approx(tuple(expected), abs=1e-12)
    assert Rotation.from_euler("ZYX", pose[3:]).as_matrix() == pytest.approx(turned.as_matrix(), abs=1e-12)


def surface_frame(network: RoadNetwork, s: float, offset: float) -> np.ndarray:
    """Return the columns forward, left, up of the lane surface by finite differences."""
    h = 1e-5
    place = [network.lane_pose_at("1", -1, s + ds, offset + dt)[:3] for ds, dt in ((h, 0), (-h, 0), (0, h), (0, -h))]
    along, across = np.subtract(place[0], place[1]), np.subtract(place[2], place[3])
    up = np.cross(along, across)
    columns = [along, np.cross(up, along), up]
    return np.column_stack([column / np.linalg.norm(column) for column in columns])


@pytest.mark.parametrize("offset", [-1.0, 0.0, 1.2])
@pytest.mark.parametrize("twist", [0.0, 0.02])
def test_lane_pose_lies_in_the_surface(twist: float, offset: float) -> None:
    bend = '<geometry s="0" x="3" y="4" hdg="0.7" length="20"><arc curvature="0.03"/></geometry>'
    text = road_xml(length=20.0, geometry=bend, lanes=lane(3.0, -1.0), profiles=profiles(CREST, 0.5, twist))
    network = RoadNetwork.parse(map_xml(text))
    for s in (2.0, 9.0, 16.0):
        pose = network.lane_pose_at("1", -1, s, offset)
        body = Rotation.from_euler("ZYX", pose[3:]).as_matrix()
        assert body == pytest.approx(surface_frame(network, s, offset), abs=1e-6)
        many = network.lane_pose("1", -1, np.array([s]), offset)
        assert [float(axis[0]) for axis in many] == pytest.approx(list(pose), abs=1e-12)


@pytest.mark.parametrize("s", [0.5, 1.0, 6.0, 10.0, 17.0])
def test_locate_on_banked_slope_inverts_pose(crest: RoadNetwork, s: float) -> None:
    pose = crest.lane_pose_at("1", -1, s, 0.4)
    hint = crest.location("1", -1, min(s + 1.0, 20.0))
    for found in (crest.locate_at(pose.x, pose.y), crest.locate_at(pose.x, pose.y, hint)):
        assert found is not None
        assert (found.s, found.offset) == pytest.approx((s, 0.4), abs=1e-5)
