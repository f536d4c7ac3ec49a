"""Parked vehicles of uncertain place and velocity: the vehicle neither stands before them forever nor touches them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
import pytest
from planned_drive import FRONT, LANE, KnownBox, PlannedDrive, behavior, detections, two_lane_road
from signal_street import CAR

from eidrive_scenario.driving.planning.behavior.memory import KnownObject, ObjectMemory
from eidrive_scenario.driving.planning.behavior.prediction import Predictor
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings, position_errors
from eidrive_scenario.driving.planning.behavior.walking_pace import WalkingPace
from eidrive_scenario.roads import RoadNetwork

TIMES = np.arange(0.0, 8.01, 0.25)
PARKED = KnownBox(60.0, LANE - 2.75, kind="van", size=(5.9, 2.0), deviation=0.6)
"""Its side is 0.83 m beside that of the car; with 1.645 standard deviations, at most 0.75 m, 0.08 m are left."""
OPPOSITE = KnownBox(61.0, LANE + 2.75, size=(5.0, 2.0), deviation=0.6)
"""Leaves as little on the other side."""


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return two_lane_road()


def observed(kind: str, deviation: float, speed: float, seconds: float) -> KnownObject:
    """Return an object that stands for a second and then moves along x."""
    objects = ObjectMemory(BehaviorSettings())
    found: list[KnownObject] = []
    for tick in range(round((1.0 + seconds) / 0.1) + 1):
        now = 0.1 * tick
        moved = speed * max(now - 1.0, 0.0)
        box = KnownBox(60.0 + moved, vx=speed if now > 1.0 else 0.0, kind=kind, deviation=deviation)
        found = objects.update(detections(now, box), now)
    return found[0]


def drive(
    roads: RoadNetwork, objects: Callable[[float], Sequence[KnownBox]], seconds: float, **settings: float | bool
) -> PlannedDrive:
    run = PlannedDrive(behavior(roads, **settings), roads)
    run.run(seconds, objects)
    run.world.close()
    return run


@pytest.mark.parametrize(
    ("kind", "deviation", "speed", "seconds", "stands"),
    [
        ("car", 1.0, 0.9, 1.5, True),  # 0.9 m/s is within 1.5 m/s, and 1.35 m within 1.645 m.
        ("car", 1.0, 0.9, 2.2, False),  # It has moved 2 m.
        ("car", 1.0, 1.6, 0.1, False),  # Its speed exceeds the error.
        ("car", 0.1, 0.9, 0.1, False),
        ("pedestrian", 1.0, 0.9, 0.1, False),
        ("bicycle", 1.0, 0.9, 0.1, False),
    ],
)
def test_object_sets_off_when_it_moves_beyond_its_errors(
    kind: str, deviation: float, speed: float, seconds: float, stands: bool
) -> None:
    known = observed(kind, deviation, speed, seconds)
    assert (known.still_since is not None) is stands


@pytest.mark.parametrize("yaw", [0.0, math.pi, 0.4])
def test_vehicle_off_the_lanes_moves_along_its_axis(roads: RoadNetwork, yaw: float) -> None:
    # Beside the road, with a velocity across its axis that is within the error of 1.5 m/s.
    box = KnownBox(60.0, LANE - 5.0, vx=-0.8 * math.sin(yaw), vy=0.8 * math.cos(yaw), yaw=yaw, deviation=1.0)
    known = ObjectMemory(BehaviorSettings()).update(detections(0.0, box), 0.0)
    found = Predictor(roads, TIMES).predict(known)
    turn = found.yaw[0] - yaw
    np.testing.assert_allclose(np.abs(np.cos(turn)), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.hypot(found.x[0] - 60.0, found.y[0] - (LANE - 5.0)), 0.0, atol=1e-9)


def test_pedestrian_of_uncertain_velocity_may_move_anywhere(roads: RoadNetwork) -> None:
    box = KnownBox(60.0, LANE - 5.0, vy=1.2, kind="pedestrian", size=(0.5, 0.5), deviation=1.0)
    known = ObjectMemory(BehaviorSettings()).update(detections(0.0, box), 0.0)
    found = Predictor(roads, TIMES).predict(known)
    assert found.y[0, -1] == pytest.approx(LANE - 5.0 + 1.2 * 8.0)


def test_vehicle_passes_a_narrow_place_at_walking_pace(roads: RoadNetwork) -> None:
    run = drive(roads, lambda now: [PARKED, OPPOSITE], 45.0)
    assert run.front > 80.0
    beside = [speed for x, _, speed in run.path if PARKED.x - 4.0 < x + FRONT < PARKED.x + 3.0]
    assert max(beside) < 2.5
    assert any(reason.startswith("walking pace: ") for reason in run.reasons)
    waits = [speed for speed in run.speeds if speed < 0.3]
    assert len(waits) * 0.05 >= 5.0, "first it waits"


@pytest.mark.parametrize(("along", "across", "is_passed_at_once"), [(0.6, 0.1, True), (0.1, 0.6, False)])
def test_only_error_across_the_way_narrows_it(
    roads: RoadNetwork, along: float, across: float, is_passed_at_once: bool
) -> None:
    """A camera measures the distance of a parked vehicle worse than its direction."""
    boxes = [box._replace(deviation=along, deviation_y=across) for box in (PARKED, OPPOSITE)]
    run = drive(roads, lambda now: boxes, 45.0)
    assert run.front > 80.0
    assert any(reason.startswith("walking pace: ") for reason in run.reasons) is not is_passed_at_once


def test_error_of_a_turning_vehicle_turns_with_it() -> None:
    """Its distance is uncertain by 2 m: first in x, after a turn to the left in y."""
    known = ObjectMemory(BehaviorSettings()).update(
        detections(0.0, KnownBox(0.0, 0.0, vx=5.0, deviation=2.0, deviation_y=0.5)), 0.0
    )
    turned = np.array([[0.0, math.pi / 2.0]])
    along, across = position_errors(known, np.array([[0.0, math.pi / 2.0]]) - (turned - turned[:, :1]))
    np.testing.assert_allclose(along, [[2.0, 2.0]])
    np.testing.assert_allclose(across, [[0.5, 0.5]])


@pytest.mark.parametrize("angle", np.linspace(0.0, math.pi, 9))
def test_errors_along_and_across_are_those_of_the_rotated_covariance(angle: float) -> None:
    """P = R diag(σ²) Rᵀ: the deviation in direction u is the root of uᵀ P u."""
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    covariance = turn @ np.diag([1.5**2, 0.4**2]) @ turn.T
    found = msgspec.structs.replace(detections(0.0, KnownBox(0.0)), covariance=covariance[None])
    (known,) = ObjectMemory(BehaviorSettings()).update(found, 0.0)
    assert known.error == pytest.approx(1.5)
    directions = np.linspace(0.0, 2.0 * math.pi, 13)[None]
    along, across = position_errors([known], directions)
    for direction, first, second in zip(directions[0], along[0], across[0], strict=True):
        ahead, left = (
            np.array([math.cos(direction), math.sin(direction)]),
            np.array([-math.sin(direction), math.cos(direction)]),
        )
        assert first == pytest.approx(math.sqrt(ahead @ covariance @ ahead))
        assert second == pytest.approx(math.sqrt(left @ covariance @ left))


def test_parked_van_with_noisy_velocity_is_passed_at_walking_pace(roads: RoadNetwork) -> None:
    """The border of the image cuts the van: its place varies by 0.7 m within a second, its velocity by 3 m/s."""

    def seen(now: float) -> Sequence[KnownBox]:
        if now < 3.0:
            return [PARKED, OPPOSITE]
        phase = 2.0 * math.pi * now
        return [PARKED._replace(x=PARKED.x + 0.5 * math.sin(phase), vx=3.0 * math.cos(phase)), OPPOSITE]

    run = drive(roads, seen, 60.0)
    assert run.front > 80.0
    assert any(reason.startswith("walking pace: ") for reason in run.reasons)


@pytest.mark.parametrize(
    ("offset", "s", "error", "speed", "half_width"),
    [
        (2.6, 51.0, 0.3, 0.0, 1.35),  # Within the present gap of 1.68 m, with a margin of 0.25 m.
        (2.6, 51.0, 0.6, 0.0, 1.43),  # Limited to the gap less the margin.
        (2.1, 51.0, 0.6, 0.0, 1.05),  # Never less than the body, with a gap of 1.18 m.
        (1.9, 51.0, 0.6, 0.0, 1.65),  # The body would touch the vehicle: its place is wrong.
        (2.6, 56.0, 0.6, 0.0, 1.65),  # Ahead of the vehicle, not beside it.
        (2.6, 51.0, 0.6, 1.0, 1.65),  # It moves.
    ],
)
def test_errors_of_a_standing_vehicle_end_beside_the_ego(
    offset: float, s: float, error: float, speed: float, half_width: float
) -> None:
    """The ego, 4.9 m long and 1.84 m wide, is at s = 50 m; errors add to half of the width of the van, 2.1 m."""
    known = ObjectMemory(BehaviorSettings()).update(detections(0.0, KnownBox(s, -offset, vx=speed)), 0.0)

    def scene(more: float) -> Surroundings:
        at = np.ones((1, 2))
        return Surroundings(
            *(s * at, -offset * at, 2.5 * at, (1.05 + more) * at, speed * at, np.array([0.5]), (0,)),
            *(np.ones(1, dtype=bool), np.ones(1, dtype=bool), np.zeros(1), np.zeros((1, 2), dtype=bool)),
            *(np.zeros(1, dtype=bool), np.zeros(1, dtype=bool)),
        )

    found = WalkingPace(BehaviorSettings(), 9).scene(known, scene(error), scene(0.0), (50.0, 0.0, 2.45, 0.92))
    np.testing.assert_allclose(found.half_width, half_width)


def test_vehicle_that_sets_off_ends_walking_pace(roads: RoadNetwork) -> None:
    """A van at the roadside pulls out with 1 m/s² while the vehicle approaches it, 4 m behind."""

    def seen(now: float) -> Sequence[KnownBox]:
        since = max(now - 11.8, 0.0)
        box = PARKED._replace(x=PARKED.x + 0.5 * since**2, y=min(PARKED.y + 0.25 * since**2, LANE))
        return [box._replace(vx=since, vy=0.5 * since if box.y < LANE else 0.0), OPPOSITE]

    run = drive(roads, seen, 24.0)
    for tick, (x, y, _) in enumerate(run.path):
        van = seen(0.05 * tick)[0]
        apart_along = abs(van.x - (x + FRONT / 2.0)) - van.size[0] / 2.0 - FRONT / 2.0
        apart_across = abs(van.y - y) - van.size[1] / 2.0 - CAR.size[1] / 2.0
        assert max(apart_along, apart_across) > 0.0, "no contact"


def test_vehicle_stays_before_a_place_without_room(roads: RoadNetwork) -> None:
    near = [PARKED._replace(y=LANE - 1.9), OPPOSITE._replace(y=LANE + 1.9)]
    run = drive(roads, lambda now: near, 40.0)
    assert run.front < PARKED.x - PARKED.size[0] / 2.0
    assert run.speeds[-1] == pytest.approx(0.0, abs=0.05)


def test_walking_pace_keeps_the_margin_of_pedestrians(roads: RoadNetwork) -> None:
    person = KnownBox(60.0, LANE - 1.4, kind="pedestrian", size=(0.5, 0.5), deviation=0.1)
    run = drive(roads, lambda now: [person, OPPOSITE], 40.0)
    assert run.front < person.x


def noise(seed: int, boxes: Sequence[KnownBox]) -> Callable[[float], Sequence[KnownBox]]:
    """Return the boxes with correlated errors of place (0.5 m along, 0.25 m across) and velocity (0.4 m/s)."""
    random = np.random.default_rng(seed)
    times = np.array([8.0, 8.0, 1.0, 1.0])
    sigma = np.array([0.5, 0.25, 0.4, 0.4])
    keep = np.exp(-0.05 / times)
    state = random.normal(size=(len(boxes), 4))

    def seen(now: float) -> Sequence[KnownBox]:
        nonlocal state
        state = keep * state + np.sqrt(1.0 - keep**2) * random.normal(size=state.shape)
        errors = (sigma * state).tolist()
        return [
            box._replace(x=box.x + x, y=box.y + y, vx=vx, vy=vy)
            for box, (x, y, vx, vy) in zip(boxes, errors, strict=True)
        ]

    return seen


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(3))
def test_parked_vans_of_noisy_place_and_velocity_are_passed(roads: RoadNetwork, seed: int) -> None:
    vans = [PARKED, PARKED._replace(x=66.5)]
    run = drive(roads, noise(seed, vans), 45.0)
    assert run.front > 90.0
    for van in vans:
        beside = [y for x, y, _ in run.path if x - 1.0 < van.x + van.size[0] / 2.0 and x + FRONT > van.x - 2.95]
        assert min(beside) - CAR.size[1] / 2.0 > van.y + van.size[1] / 2.0, "no contact"
