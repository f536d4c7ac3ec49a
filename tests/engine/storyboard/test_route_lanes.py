"""Lane changes of scripted actors that their route requires."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import (
    junction_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.kinematics.motion import LateralStep, Motion
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition

TURN = 20.0 * math.pi


def lane(number: int, before: int | None = None, after: int | None = None) -> str:
    return lane_xml(number, 4, link=lane_links_xml(before, after))


@pytest.fixture
def fork() -> RoadNetwork:
    """Road a, 200 m along x: lane -1 continues straight to b, lane -2 turns right to c."""
    through = section_xml(right=lane(-1, -1, -1))
    return RoadNetwork.parse(
        map_xml(
            road_xml("a", length=200.0, link=successor_xml(junction="J"), lanes=section_xml(right=lane(-1) + lane(-2))),
            road_xml(
                "on",
                length=40.0,
                x=200.0,
                link=predecessor_xml("a") + successor_xml("b"),
                lanes=through,
                junction="J",
            ),
            road_xml(
                "off",
                length=TURN,
                x=200.0,
                y=-4.0,
                curvature=-0.025,
                link=predecessor_xml("a") + successor_xml("c"),
                lanes=section_xml(right=lane(-1, -2, -1)),
                junction="J",
            ),
            road_xml("b", x=240.0, link=predecessor_xml(junction="J"), lanes=through),
            road_xml("c", x=240.0, y=-44.0, hdg=-math.pi / 2, link=predecessor_xml(junction="J"), lanes=through),
            rest=junction_xml("J", "a", {"on": -1, "off": -2}),
        )
    )


def on_its_way(fork: RoadNetwork, start: int, s: float, destination: str) -> Motion:
    motion = Motion(fork)
    here = fork.location("a", start, s)
    motion.teleport(ResolvedPosition(fork.pose(here), here))
    motion.initialize()
    motion.set_speed(20.0)
    motion.set_route(fork.route(here, fork.location(destination, -1, 90.0)))
    return motion


def driven(motion: Motion, seconds: float) -> np.ndarray:
    rows = []
    for _ in range(round(seconds / 0.05)):
        placement = motion.step(0.05)
        rows.append((placement.x, placement.y, placement.yaw))
    return np.array(rows)


@pytest.mark.parametrize("s", [20.0, 185.0], ids=["far before the fork", "close before it"])
def test_actor_changes_to_the_lane_of_its_route(fork: RoadNetwork, s: float) -> None:
    motion = on_its_way(fork, -1, s, "c")
    track = driven(motion, (200.0 - s + TURN + 30.0) / 20.0)
    assert motion.location is not None
    assert motion.location.road == "c"
    assert motion.location.offset == pytest.approx(0.0, abs=1e-6)
    assert track[-1, 2] == pytest.approx(-math.pi / 2)
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert steps == pytest.approx(np.ones(len(steps)), abs=0.03)
    before = track[track[:, 0] < max(160.0, s) - 1.0]
    assert before[:, 1] == pytest.approx(np.full(len(before), -2.0))
    ahead = np.arctan2(*np.diff(track[:, :2], axis=0).T[::-1])
    assert track[1:, 2] == pytest.approx(ahead, abs=0.1)


@pytest.mark.parametrize(("start", "destination", "y"), [(-1, "b", -2.0), (-2, "c", -6.0)])
def test_actor_keeps_lane_that_continues_the_route(fork: RoadNetwork, start: int, destination: str, y: float) -> None:
    motion = on_its_way(fork, start, 20.0, destination)
    track = driven(motion, 8.9)
    assert track[:, 1] == pytest.approx(np.full(len(track), y))
    driven(motion, 5.0)
    assert motion.location is not None
    assert motion.location.road == destination


def test_lateral_action_suppresses_lane_change_of_route(fork: RoadNetwork) -> None:
    motion = on_its_way(fork, -1, 20.0, "c")
    for _ in range(230):
        motion.set_lateral_step(LateralStep(0.5))
        motion.step(0.05)
    assert motion.location is not None
    assert motion.location.road == "b"
    assert motion.pose.y == pytest.approx(-1.5)


def test_teleport_ends_lane_change_of_route(fork: RoadNetwork) -> None:
    """The lane change before the junction ends; on a road outside of the route there is none."""
    motion = on_its_way(fork, -1, 170.0, "c")
    assert driven(motion, 0.5)[-1, 1] < -2.0
    for road_id, s in (("a", 20.0), ("b", 80.0)):
        here = fork.location(road_id, -1, s)
        motion.teleport(ResolvedPosition(fork.pose(here), here))
        assert driven(motion, 0.5)[:, 1] == pytest.approx(np.full(10, -2.0))
