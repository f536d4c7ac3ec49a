"""Comparison of scalar and array poses, which are implemented separately, on many random roads."""

from __future__ import annotations

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml, section_xml

from eidrive_scenario.roads import RoadNetwork

ROADS = 60
LENGTH = 80.0


def cubic(name: str, start: str, coefficients: np.ndarray) -> str:
    a, b, c, d = (float(value) for value in coefficients)
    return f'<{name} {start}="0" a="{a!r}" b="{b!r}" c="{c!r}" d="{d!r}"/>'


def curve(draw: np.random.Generator, kind: int) -> str:
    start, end = (float(value) for value in draw.uniform(-0.05, 0.05, 2))
    u, v = (float(value) for value in draw.uniform(-2e-3, 2e-3, 2))
    return (
        "<line/>",
        f'<arc curvature="{start!r}"/>',
        f'<spiral curvStart="{start!r}" curvEnd="{end!r}"/>',
        f'<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="{u / 10!r}" dU="0" aV="0" bV="0" cV="{v!r}" dV="0"/>',
    )[kind]


def random_road(draw: np.random.Generator, number: int) -> str:
    """Return a road with bends, slopes and lanes of changing width; a quarter of the roads has no superelevation."""
    x, y, hdg = (float(value) for value in draw.uniform(-3.0, 3.0, 3))
    shape = curve(draw, number % 4)
    widths = [
        cubic("width", "sOffset", np.array([3.5, 0.0, 0.0, 0.0]) + draw.normal(size=4) * scale)
        for scale in [np.array([0.3, 0.01, 1e-4, 1e-6])] * 3
    ]
    lanes = [
        f'<lane id="{lane}" type="driving">{width}</lane>' for lane, width in zip((1, -1, -2), widths, strict=True)
    ]
    offset = cubic("laneOffset", "s", draw.normal(size=4) * [1.0, 0.02, 1e-4, 1e-6])
    climb = cubic("elevation", "s", draw.normal(size=4) * [20.0, 0.1, 1e-3, 1e-5])
    bank = cubic("superelevation", "s", draw.normal(size=4) * [0.2, 3e-3, 1e-5, 1e-7])
    lateral = "" if number % 16 < 4 else f"<lateralProfile>{bank}</lateralProfile>"
    return road_xml(
        str(number),
        length=LENGTH,
        geometry=f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{LENGTH!r}">{shape}</geometry>',
        lanes=offset + section_xml(lanes[0], lanes[1] + lanes[2]),
        profiles=f"<elevationProfile>{climb}</elevationProfile>{lateral}",
    )


@pytest.fixture
def draw() -> np.random.Generator:
    return np.random.default_rng(20)


@pytest.fixture
def network(draw: np.random.Generator) -> RoadNetwork:
    return RoadNetwork.parse(map_xml(*(random_road(draw, number) for number in range(ROADS))))


def compare_poses(network: RoadNetwork, s: np.ndarray, offset: np.ndarray) -> list[float]:
    """Assert that poses of points and of arrays are equal on all lanes, and return the roll of each."""
    rolls = []
    for number in network.roads:
        for lane in (1, 0, -1, -2):
            many = np.column_stack(network.lane_pose(number, lane, s, offset))
            single = [network.lane_pose_at(number, lane, float(a), float(b)) for a, b in zip(s, offset, strict=True)]
            assert many == pytest.approx(np.array(single), abs=1e-11, rel=0.0), (number, lane)
            rolls += [pose.r for pose in single]
        many = np.column_stack(network.road_pose(number, s, offset))
        single = [network.road_pose_at(number, float(a), float(b)) for a, b in zip(s, offset, strict=True)]
        assert many == pytest.approx(np.array(single), abs=1e-11, rel=0.0), number
    return rolls


def test_poses_of_points_and_arrays_agree_on_random_roads(network: RoadNetwork, draw: np.random.Generator) -> None:
    s, offset = draw.uniform(0.0, LENGTH, 25), draw.uniform(-2.0, 2.0, 25)
    rolls = compare_poses(network, s, offset)
    assert np.ptp(rolls) > 1.0  # The roads are banked to both sides.


@pytest.mark.parametrize("s", [-0.1, -0.01, LENGTH + 0.01, LENGTH + 0.1])
def test_poses_of_points_and_arrays_agree_just_beyond_roads(network: RoadNetwork, s: float) -> None:
    compare_poses(network, np.full(3, s), np.array([-2.0, 0.0, 2.0]))


@pytest.mark.parametrize("number", range(16))
def test_locate_points_equals_locate_arrays_on_random_roads(number: int) -> None:
    """Each road is in a separate network, as random roads overlap. Both methods find the position of the pose."""
    draw = np.random.default_rng(number)
    network = RoadNetwork.parse(map_xml(random_road(draw, number)))
    s, t = draw.uniform(1.0, LENGTH - 1.0, 40), draw.uniform(-5.0, 3.0, 40)
    poses = network.road_pose(str(number), s, t)
    many = network.locate(poses.x, poses.y)
    assert many.s == pytest.approx(s, abs=1e-5)
    assert many.t == pytest.approx(t, abs=1e-5)
    for a, b, x, y in zip(s.tolist(), t.tolist(), poses.x.tolist(), poses.y.tolist(), strict=True):
        found = network.locate_at(x, y, network.road_location(str(number), min(a + 0.5, LENGTH), b))
        assert found is not None
        assert (found.s, found.t) == pytest.approx((a, b), abs=1e-5)
