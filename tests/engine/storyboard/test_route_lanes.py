"""Lane changes of scripted actors that their route requires."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.kinematics.motion import LateralStep, Motion
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition

TURN = 20.0 * math.pi


def lane(number: int, before: int | None = None, after: int | None = None) -> str:
    links = [f'<{tag} id="{n}"/>' for tag, n in (("predecessor", before), ("successor", after)) if n is not None]
    return (
        f'<lane id="{number}" type="driving"><link>{"".join(links)}</link>'
        '<width sOffset="0" a="4" b="0" c="0" d="0"/></lane>'
    )


def road(
    number: str,
    length: float,
    x: float,
    y: float,
    hdg: float,
    lanes: str,
    links: str,
    junction: str = "-1",
    bend: str = "",
) -> str:
    shape = f'<arc curvature="{bend}"/>' if bend else "<line/>"
    return (
        f'<road id="{number}" length="{length!r}" junction="{junction}"><link>{links}</link><planView>'
        f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}">{shape}</geometry></planView>'
        f'<lanes><laneSection s="0"><center><lane id="0"/></center><right>{lanes}</right></laneSection></lanes></road>'
    )


def link(tag: str, number: str) -> str:
    if number == "J":
        return f'<{tag} elementType="junction" elementId="J"/>'
    return (
        f'<{tag} elementType="road" elementId="{number}" contactPoint="{"end" if tag == "predecessor" else "start"}"/>'
    )


@pytest.fixture
def fork() -> RoadNetwork:
    """Road a, 200 m along x: lane -1 continues straight to b, lane -2 turns right to c."""
    connections = "".join(
        f'<connection id="{name}" incomingRoad="a" connectingRoad="{name}" contactPoint="start">'
        f'<laneLink from="{number}" to="-1"/></connection>'
        for name, number in (("on", -1), ("off", -2))
    )
    through = lane(-1, -1, -1)
    return RoadNetwork.parse(
        "<OpenDRIVE>"
        + road("a", 200.0, 0.0, 0.0, 0.0, lane(-1) + lane(-2), link("successor", "J"))
        + road("on", 40.0, 200.0, 0.0, 0.0, through, link("predecessor", "a") + link("successor", "b"), "J")
        + road(
            *("off", TURN, 200.0, -4.0, 0.0, lane(-1, -2, -1), link("predecessor", "a") + link("successor", "c"), "J"),
            bend="-0.025",
        )
        + road("b", 100.0, 240.0, 0.0, 0.0, through, link("predecessor", "J"))
        + road("c", 100.0, 240.0, -44.0, -math.pi / 2, through, link("predecessor", "J"))
        + f'<junction id="J" name="">{connections}</junction></OpenDRIVE>'
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
