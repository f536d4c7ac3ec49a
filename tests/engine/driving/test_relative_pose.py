"""Pose errors in fusion: objects are fused relative to the assumed pose of the receiver."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.communication.report_store import relative_state
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.fusion.tracks import pose_part
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.world.actor import ActorSpec

EGO = EgoState(0.0, np.array([5.0, 1.0, 0.0]), 0.3, 0.0, 0.0, 0.0, 0.0, 0.0)
RSU = StationState(0.0, 40.0, -7.0, 0.0, 0.0, 0.0, np.diag([0.04, 0.04, 1e-4]))


def seen(*places: tuple[float, float], time: float = 0.0) -> Detections:
    count = len(places)
    boxes = np.array([(x, y, 0.75, 4.5, 1.8, 1.5, 0.0) for x, y in places]).reshape(-1, 7)
    covariance = np.tile(0.01 * np.eye(2), (count, 1, 1))
    return Detections(time, boxes, np.ones(count), ("car",) * count, np.zeros((count, 2)), covariance)


class OneCar(Detector):
    """Detector that finds a car 20 m ahead of the station."""

    provides_velocity = True

    def detect(self, readings: Readings) -> Detections:
        x, y, _ = readings.ego.position.tolist()
        yaw = readings.ego.yaw
        return seen((x + 20.0 * math.cos(yaw), y + 20.0 * math.sin(yaw)), time=readings.time)


def act(car: ActorSpec, *places: tuple[float, float], detector: Detector | None = None) -> tuple[Agent, AgentStep]:
    """Return the ego with a noisy pose, and its step after a report of cars at these places."""
    noise = {"position": 0.5, "yaw": 1.0}
    settings = AgentSettings.model_validate({"planner": "none", "pose_noise": noise, "cooperates_with": "all"})
    agent = build_agent(settings, car, None, seed=3, dt=0.05, detector=detector)
    message = Message("RSU", 0, 0.0, RSU, seen(*places), 0)
    return agent, agent.act(Readings(0.0, EGO), (ReceivedMessage(message, 0.0),), 0.0, None)


def test_error_of_the_receiver_is_that_of_its_rotation_about_itself() -> None:
    """Jacobian of a point in the frame of the receiver, by finite differences over x, y and yaw of its pose."""
    own = np.diag([0.09, 0.16, 0.01])
    point = np.array([55.0, 12.0])

    def relative(x: float, y: float, yaw: float) -> Array:
        """Return where the receiver with this pose error places a point that it knows in the world frame."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        return EGO.position[:2] + np.array([[cos, sin], [-sin, cos]]) @ (point - EGO.position[:2] - (x, y))

    step = 1e-6
    jacobian = np.stack([(relative(*row) - relative(0, 0, 0)) / step for row in step * np.eye(3)], axis=1)
    state = relative_state(StationState(0.0, 40.0, -7.0, 0.0, 0.0, 0.0), EGO, own)
    assert state is not None
    assert state.pose_covariance is not None
    found = pose_part(point[None], state.x, state.y, state.pose_covariance)[0]
    assert found == pytest.approx(jacobian @ own @ jacobian.T, rel=1e-5)


def test_exact_pose_of_the_receiver_changes_nothing() -> None:
    assert relative_state(RSU, EGO, None) is RSU
    assert relative_state(None, EGO, np.eye(3)) is None


def test_pose_errors_of_both_stations_are_those_of_a_received_object(car: ActorSpec) -> None:
    agent, step = act(car, (40.0, 30.0))
    assert step.estimate is not None
    own = relative_state(RSU, step.estimate, agent.perception.pose_covariance)
    assert own is not None
    assert own.pose_covariance is not None
    expected = 0.01 * np.eye(2) + pose_part(np.array([[40.0, 30.0]]), RSU.x, RSU.y, own.pose_covariance)[0]
    assert step.fused.covariance[0] == pytest.approx(expected)


def test_reports_with_pose_errors_do_not_move_own_detections(car: ActorSpec) -> None:
    """An own detection is exact relative to the assumed pose. A report of the same car 0.6 m beside it has a larger
    covariance in all directions, so that covariance intersection gives it no weight, up to the percent of the trace
    within which the weight is nearest to one half."""
    _, alone = act(car, detector=OneCar())
    x, y = alone.fused.boxes[0, :2].tolist()
    _, together = act(car, (x + 0.4, y - 0.4), detector=OneCar())
    assert len(together.fused) == 1
    assert together.fused.boxes[0, :2].tolist() == pytest.approx([x, y], abs=0.01)
    assert together.fused.covariance[0] == pytest.approx(0.01 * np.eye(2), rel=0.02, abs=1e-3)
