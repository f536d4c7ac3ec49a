"""Identification of the ego body among received objects, by the covariances of both."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import ActorSpec

Place = tuple[float, float]
FAR_CAMERA = np.diag([3.7**2, 0.4**2])
"""Covariance of a vehicle 40 m ahead of a camera that looks along x [m²]."""


def body(car: ActorSpec, yaw: float = 0.0, speed: float = 0.0) -> OwnBody:
    """Ego whose body center is at the origin at time 0."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead = car.offset[0]
    own = OwnBody(car, duration=1.0, dt=0.05)
    own.record(EgoState(0.0, np.array([-ahead * cos, -ahead * sin, 0.0]), yaw, 0.0, 0.0, speed, 0.0, 0.0))
    return own


def seen(
    *places: Place, kind: str = "car", covariance: Array = FAR_CAMERA, tracks: tuple[int, ...] = (), time: float = 0.0
) -> Detections:
    count = len(places)
    return Detections(
        time,
        np.array([(x, y, 0.8, 4.6, 1.8, 1.5, 0.0) for x, y in places]).reshape(count, 7),
        np.ones(count),
        (kind,) * count,
        np.zeros((count, 2)),
        np.repeat(covariance[None], count, axis=0),
        tracks,
    )


def kept(
    own: OwnBody,
    found: Detections,
    *,
    state: StationState | None = None,
    perceived: Detections | None = None,
    pose_covariance: Array | None = None,
) -> list[Place]:
    left = own.without_perceived(found, "RSU", state, perceived, pose_covariance)
    return [(x, y) for x, y in left.boxes[:, :2].tolist()]


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2.0, -2.5])
def test_body_is_found_within_the_gate_only(car: ActorSpec, yaw: float) -> None:
    """99 % of errors with 3.7 m standard deviation in one of two directions are below 3.7 √9.21 = 11.23 m."""
    assert kept(body(car, yaw), seen((11.2, 0.0))) == []
    assert kept(body(car, yaw), seen((-11.2, 0.0))) == []
    assert kept(body(car, yaw), seen((11.3, 0.0))) == [(11.3, 0.0)]
    assert kept(body(car, yaw), seen((8.0, 3.0))) == [(8.0, 3.0)]


def test_station_reports_the_body_once(car: ActorSpec) -> None:
    assert kept(body(car), seen((9.0, 0.0), (6.0, 0.2), (-8.0, 0.0))) == [(9.0, 0.0), (-8.0, 0.0)]
    assert kept(body(car), seen((9.0, 0.0), (0.5, 0.2))) == [(9.0, 0.0)]


def test_body_beside_the_outline_is_found_with_another_vehicle_on_it(car: ActorSpec) -> None:
    """With a standard deviation of 0.7 m in each axis the squared distances are 11.0 at the front left corner of the
    outline and 8.8 beside it, within the gate of 9.21. No vehicle can be on the outline either."""
    vague = np.diag([0.25, 0.25])
    report = seen((2.2, 0.8), (0.0, -2.1), covariance=vague)
    assert kept(body(car), report, pose_covariance=np.diag([0.25, 0.25, 1e-4])) == []


@pytest.mark.parametrize(("velocity", "left"), [(10.0, (-1.0, 2.0)), (math.nan, (1.0, -2.2))])
def test_body_is_the_vehicle_with_its_velocity(car: ActorSpec, velocity: float, left: Place) -> None:
    """A parked car is reported nearer to the moving ego than its body: without velocities it would be the body."""
    report = seen((1.0, -2.2), (-1.0, 2.0), covariance=np.diag([1.0, 1.0]))
    report = replace(report, velocity=np.array([(velocity, 0.0), (0.0 * velocity, 0.0)]))
    assert kept(body(car, speed=10.0), report) == [left]


@pytest.mark.parametrize("kind", ["pedestrian", "bicycle", "motorbike"])
def test_vulnerable_road_users_are_not_the_body_of_a_car(car: ActorSpec, kind: str) -> None:
    assert kept(body(car), seen((6.0, 0.0), kind=kind)) == [(6.0, 0.0)]


def test_vehicle_beside_a_roadside_unit_is_not_its_body() -> None:
    mast = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))
    assert kept(body(mast), seen((6.0, 0.0))) == [(6.0, 0.0)]
    assert kept(body(mast), seen((6.0, 0.0), kind="misc")) == []


def test_object_that_own_sensors_perceive_is_kept(car: ActorSpec) -> None:
    """The vehicle ahead moved 2 m since it was perceived."""
    lead = seen((6.0, 0.0), covariance=np.diag([0.04, 0.04]), time=-0.2)
    lead.velocity[:] = 10.0, 0.0
    assert kept(body(car), seen((8.0, 0.0)), perceived=lead) == [(8.0, 0.0)]
    assert kept(body(car), seen((8.0, 0.0)), perceived=seen((30.0, 0.0))) == []
    assert kept(body(car), seen((8.0, 0.0), (3.8, 0.0)), perceived=lead) == [(8.0, 0.0)]


def test_precise_report_beside_the_body_is_kept(car: ActorSpec) -> None:
    for covariance in (np.diag([0.1, 0.1]), np.zeros((2, 2)), np.full((2, 2), np.nan)):
        assert kept(body(car), seen((6.0, 0.0), covariance=covariance)) == [(6.0, 0.0)]


def test_errors_of_both_poses_widen_the_gate(car: ActorSpec) -> None:
    """1 ° at 100 m is 1.75 m aside, and 2 m of position error reach √9.21 times as far."""
    exact = np.diag([0.01, 0.01])
    aside = seen((0.0, 4.0), covariance=exact)
    turned = StationState(0.0, -100.0, 0.0, 0.0, 0.0, 0.0, np.diag([1e-6, 1e-6, math.radians(1.0) ** 2]))
    assert kept(body(car), aside) == [(0.0, 4.0)]
    assert kept(body(car), aside, state=turned) == []
    vague = np.diag([4.0, 4.0, 0.01])
    assert kept(body(car), aside, pose_covariance=vague) == []
    assert kept(body(car), seen((0.0, 6.2), covariance=exact), pose_covariance=vague) == [(0.0, 6.2)]


def test_body_stays_the_same_track_of_a_station(car: ActorSpec) -> None:
    own = body(car)
    assert kept(own, seen((16.0, 0.0), tracks=(5,))) == [(16.0, 0.0)]
    assert kept(own, seen((8.0, 0.0), tracks=(5,))) == []
    assert kept(own, seen((16.0, 0.0), tracks=(5,))) == []
    assert kept(own, seen((16.0, 0.0), tracks=(6,))) == [(16.0, 0.0)]
    assert kept(own, seen((20.0, 0.0), tracks=(5,))) == [(20.0, 0.0)]


def test_station_that_has_just_reported_the_body_reports_it_again(car: ActorSpec) -> None:
    """The error of a pose lasts: a deviation of 4 standard deviations, which is outside the gate of 99 %, is the body
    if the station reported the body within the last second, and if no other object of its report is likelier."""
    far, near = seen((15.0, 0.0)), seen((8.0, 0.0))
    assert kept(body(car), far) == [(15.0, 0.0)]
    for pause, expected in ((0.5, []), (1.5, [(15.0, 0.0)])):
        own = body(car)
        assert kept(own, near) == []
        assert kept(own, replace(far, time=pause)) == expected
    own = body(car)
    assert kept(own, near) == []
    assert kept(own, replace(seen((15.0, 0.0), (3.0, 0.0)), time=0.1)) == [(15.0, 0.0)]


def test_empty_reports_and_those_older_than_the_history_are_read(car: ActorSpec) -> None:
    assert kept(body(car), seen()) == []
    assert kept(body(car), seen((5.0, 0.0), time=-30.0)) == []
    assert kept(body(car), seen((40.0, 0.0), time=60.0)) == [(40.0, 0.0)]


def test_objects_far_from_all_places_of_the_body_are_kept(car: ActorSpec) -> None:
    """A single object is compared with the outline at its time; the result is that of the same object in a list."""
    rng = np.random.default_rng(2)
    own = OwnBody(car, duration=1.0, dt=0.05)
    for tick in range(40):
        angle = 0.1 * tick
        position = np.array([20.0 * math.cos(angle), 20.0 * math.sin(angle), 0.0])
        own.record(EgoState(0.05 * tick, position, angle + math.pi / 2.0, 0.0, 40.0, 0.0, 0.0, 0.0))
    far_away = (500.0, 500.0)
    removed = 0
    for _ in range(2000):
        time, place = rng.uniform(0.0, 2.0), (rng.uniform(-25.0, 25.0), rng.uniform(-25.0, 25.0))
        alone = len(own.without(seen(place, time=time)))
        assert alone == len(own.without(seen(place, far_away, time=time))) - 1
        removed += alone == 0
    assert removed > 5


@pytest.mark.parametrize(("height", "left"), [(2.5, []), (6.5, [(0.2, 0.0)])])
def test_car_below_or_on_a_bridge_is_not_the_body(car: ActorSpec, height: float, left: list[Place]) -> None:
    """Errors of the height of a box by 2.5 m do not keep the body."""
    objects = seen((0.2, 0.0))
    objects.boxes[:, 2] += height
    assert kept(body(car), objects) == left
    assert body(car).without(objects).boxes[:, :2].tolist() == [list(place) for place in left]


def test_former_places_of_the_body_are_not_held_under_old_ids(car: ActorSpec) -> None:
    """A station reports the ego as object 3, and 0.4 s and 4 m later as object 5, in messages that list a part."""
    settings = AgentSettings.model_validate({"fusion": "average", "planner": "none"})
    agent = build_agent(settings, car, None, seed=0, dt=0.05)
    agent.receives_messages = True
    ahead, pillar = car.offset[0], (30.0, 9.0)
    for tick in range(9):
        now, x = 0.05 * tick, 0.5 * tick
        inbox = []
        if tick in (0, 8):
            places, ids = ((x + ahead, 0.0), pillar), ((3, 4) if tick == 0 else (5, 4))
            detections = seen(*places, covariance=np.diag([0.04, 0.04]), time=now)
            state = StationState(now, 40.0, 9.0, 0.0, 0.0, 0.0)
            inbox = [ReceivedMessage(Message("RSU", tick, now, state, detections, 200, objects=ids), now)]
        ego = EgoState(now, np.array([x, 0.0, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        nothing = TruthReading((), (), np.zeros((0, 7)), np.zeros((0, 2)), np.ones(0))
        agent.act(Readings(now, ego, nothing), inbox, now, None)
    (report,) = (report for report in agent.reports if report.station == "RSU")
    assert report.detections.boxes[:, :2].tolist() == [list(pillar)]
