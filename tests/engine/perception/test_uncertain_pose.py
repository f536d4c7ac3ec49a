"""Tracking by a station with a random pose error: closed forms of its limits, and consistency in between."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.fusion.tracks import pose_part
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.localization import PoseNoise, PoseNoiseProcess
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.method import TrackerSettings
from eidrive_scenario.perception.tracking.motion_models import ConstantVelocity, Estimates, MotionModel, TurnRate
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.perception.tracking.uncertain_pose import PoseErrors, PoseUncertainty, UncertainPose
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading

STATION = (5.0, 1.0)
CAR = np.array([[5.0, 31.0, 0.7, 4.0, 1.8, 1.4, 0.0]])
POSE = np.diag([0.09, 0.09, math.radians(1.0) ** 2])
NOISE = 0.01 * np.eye(2)[None]
UNKNOWN = np.full((1, 2), np.nan)


def pose_errors(covariance: Array, kept: float, count: int = 30) -> PoseErrors:
    """Return the errors of `count` poses, 0.1 s apart, whose correlation from one to the next is `kept`."""
    errors = PoseErrors()
    for step in range(count):
        errors.add(PoseUncertainty(0.1 * step, *STATION, covariance, kept * np.eye(3)))
    return errors


def filtered(model: MotionModel, boxes: list[Array], noise: Array, errors: PoseErrors | None = None) -> Estimates:
    held = model.begin(boxes[0], UNKNOWN, noise)
    for step, box in enumerate(boxes[1:], 1):
        predicted = model.predict(held, 0.1)
        if errors is not None:
            errors.advance(0.1 * step)
        held = model.update(predicted, box, noise).estimates
    return held


def measured(count: int = 30) -> list[Array]:
    random = np.random.default_rng(3)
    return [CAR + np.concatenate([random.normal(0.0, 0.3, 2), np.zeros(5)]) for _ in range(count)]


def test_independent_pose_errors_are_measurement_noise() -> None:
    """Closed form: a pose error drawn again in each scan adds J P Jᵀ to the measurement noise. The range is 30 m across
    the x axis, so that the heading contributes to x: 0.09 + (30 m · 1°)² = 0.364 m². The range changes by 1 % between
    scans, and this variance by 2 %."""
    own = pose_part(CAR[:, :2], *STATION, POSE)
    assert own[0, 0, 0] == pytest.approx(0.09 + math.radians(30.0) ** 2)
    errors = pose_errors(POSE, 0.0)
    found = filtered(UncertainPose(ConstantVelocity(), errors), measured(), NOISE, errors)
    expected = filtered(ConstantVelocity(), measured(), NOISE + own)
    assert found.state[0, 2:4] == pytest.approx(expected.state[0, 2:4], abs=0.03)
    assert found.covariance[0, 2:4, 2:4] == pytest.approx(expected.covariance[0, 2:4, 2:4], rel=0.02, abs=0.01)


@pytest.mark.parametrize("model", [ConstantVelocity(), TurnRate()])
def test_constant_pose_error_leaves_the_filter_unchanged(model: MotionModel) -> None:
    """An error of infinite correlation time moves the whole scene, which motion relative to the pose cannot show."""
    errors = pose_errors(np.diag([0.09, 0.09, 0.0]), 1.0)
    found = filtered(UncertainPose(model, errors), measured(), NOISE, errors)
    expected = filtered(model, measured(), NOISE)
    assert found.state[0, : model.size] == pytest.approx(expected.state[0])
    assert found.covariance[0, : model.size, : model.size] == pytest.approx(expected.covariance[0])


class NoisyDetector(Detector):
    needs = frozenset({"truth"})

    def __init__(self) -> None:
        self._random = np.random.default_rng(7)

    def detect(self, readings: Readings) -> Detections:
        assert readings.truth is not None
        boxes = readings.truth.boxes.copy()
        boxes[:, :2] += self._random.normal(0.0, 0.1, (len(boxes), 2))
        count = len(boxes)
        return Detections(
            readings.time,
            boxes,
            np.full(count, 0.9),
            ("car",) * count,
            np.repeat(UNKNOWN, count, 0),
            np.repeat(NOISE, count, 0),
        )


@pytest.mark.exhaustive
@pytest.mark.parametrize("span", [0.0, 0.3, 3.0])
@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_parked_car_is_tracked_consistently(kind: str, span: float) -> None:
    """NEES of positions relative to the assumed pose: 2 on average for a consistent filter, less if motion is weaker
    than assumed. Without the pose error in the filter it was 39 for cv without correlation, with speeds of 13 m/s. A
    car that stands gets no speed from the pose error, which is 0.6 m at its place."""
    noise = PoseNoiseProcess(PoseNoise(position=0.3, yaw=1.0, correlation_time=span), "RSU", 1)
    settings = TrackerSettings.model_validate({"kind": kind})
    perception = Perception(NoisyDetector(), tracker=Tracker(settings), pose_noise=noise)
    truth = TruthReading(("Car",), ("car",), CAR, np.zeros((1, 2)), np.ones(1))
    squared, speeds = [], []
    for tick in range(600):
        now = 0.05 * tick
        ego = EgoState(now, np.array([*STATION, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        readings = perception.locate(Readings(now, ego, truth=None if tick % 2 else truth))
        found = perception.perceive(readings)
        if tick < 60 or found is None:
            continue
        x, y, yaw = noise.error(now).tolist()
        offset = CAR[0, :2] - np.array(STATION)
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        error = found.boxes[0, :2] - (np.add(STATION, (x, y)) + turn @ offset)
        squared.append(error @ np.linalg.solve(found.covariance[0], error))
        speeds.append(float(np.hypot(*found.velocity[0])))
    assert len(squared) == 540
    assert 1.5 < np.mean(squared) < 2.5
    assert np.mean(speeds) < 0.2


@pytest.mark.parametrize("kind", ["cv", "ctrv"])
def test_tracks_that_share_strong_yaw_errors_are_consistent(kind: str) -> None:
    """NEES as above, 2 on average, with errors of the yaw of 2°, 1.4 m at the farthest car. What the boxes of other
    cars show of the pose error cannot make a covariance negative."""
    cars = np.repeat(CAR, 4, axis=0)
    cars[:, :2] = (45.0, 2.0), (25.0, -4.0), (-35.0, 2.0), (5.0, 31.0)
    truth = TruthReading(tuple("ABCD"), ("car",) * 4, cars, np.zeros((4, 2)), np.ones(4))
    squared = []
    for seed in range(2):
        noise = PoseNoiseProcess(PoseNoise(position=0.1, yaw=2.0, correlation_time=0.1), "RSU", seed)
        tracker = Tracker(TrackerSettings.model_validate({"kind": kind}))
        perception = Perception(NoisyDetector(), tracker=tracker, pose_noise=noise)
        for tick in range(100):
            now = 0.1 * tick
            ego = EgoState(now, np.array([*STATION, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            tracks = perception.perceive(perception.locate(Readings(now, ego, truth=truth)))
            assert tracks is not None
            assert np.linalg.eigvalsh(tracker._tracks.covariance).min(initial=0.0) > -1e-9
            x, y, yaw = noise.error(now).tolist()
            turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
            errors = tracks.boxes[:, None, :2] - (np.add(STATION, (x, y)) + (cars[:, :2] - STATION) @ turn.T)
            nearest = errors[np.arange(len(tracks)), np.square(errors).sum(axis=2).argmin(axis=1)]
            if tick >= 30:
                squared += np.einsum("ni,nij,nj->n", nearest, np.linalg.inv(tracks.covariance), nearest).tolist()
    assert len(squared) >= 500
    assert 1.5 < np.mean(squared) < 2.5
