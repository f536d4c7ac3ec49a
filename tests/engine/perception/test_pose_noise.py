"""Random pose error: its distribution, its correlation, and its effect on readings and messages."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.localization import PoseNoise, PoseNoiseProcess
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading

EGO = EgoState(0.0, np.array([5.0, 1.0, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Nothing(Detector):
    def detect(self, readings: Readings) -> Detections:
        return Detections(readings.time)


def errors(count: int = 4000, *, span: float = 0.0, step: float = 0.1, seed: int = 1, deviation: float = 0.4) -> Array:
    process = PoseNoiseProcess(PoseNoise(position=deviation, yaw=2.0, correlation_time=span), "RSU", seed)
    return np.array([process.error(step * number) for number in range(count)])


def test_errors_have_the_standard_deviations_and_are_independent() -> None:
    """Of 4,000 draws the sample deviation is within 4 % (3.6 standard errors), correlations are within 0.06."""
    found = errors()
    assert found.std(axis=0) == pytest.approx([0.4, 0.4, math.radians(2.0)], rel=0.04)
    assert np.abs(np.corrcoef(found.T) - np.eye(3)).max() < 0.06
    assert abs(np.corrcoef(found[:-1, 0], found[1:, 0])[0, 1]) < 0.06


def test_correlation_decreases_exponentially() -> None:
    """Over 0.5 s at a correlation time of 1 s it is e^-0.5; the deviation remains that of the settings."""
    found = errors(40_000, span=1.0)[:, 0]
    assert np.corrcoef(found[:-5], found[5:])[0, 1] == pytest.approx(math.exp(-0.5), abs=0.04)
    assert found.std() == pytest.approx(0.4, rel=0.06)


def test_deviations_scale_equal_draws_of_a_seed() -> None:
    assert errors(10, deviation=0.2)[:, :2] == pytest.approx(errors(10)[:, :2] / 2.0)
    assert not np.allclose(errors(10, seed=2), errors(10))


def test_error_is_constant_within_a_time_step() -> None:
    process = PoseNoiseProcess(PoseNoise(position=1.0), "RSU", 1)
    first = process.error(0.1).copy()
    assert (process.error(0.1) == first).all()
    assert (process.error(0.2) != first)[:2].all()


def test_noise_moves_pose_and_objects_alike_and_its_covariance_is_stated() -> None:
    """An object keeps its place relative to the assumed pose, which is what the sensors of the station measure."""
    process = PoseNoiseProcess(PoseNoise(position=1.0, yaw=5.0), "RSU", 1)
    perception = Perception(Nothing(), pose_noise=process)
    boxes = np.array([[15.0, 1.0, 0.7, 4.0, 1.8, 1.4, 0.0]])
    truth = TruthReading(("Car",), ("car",), boxes, np.array([[2.0, 0.0]]), np.ones(1))
    moved = perception.locate(Readings(0.0, EGO, truth=truth))
    assert moved.truth is not None
    offset = moved.truth.boxes[0, :2] - moved.ego.position[:2]
    assert np.linalg.norm(moved.ego.position - EGO.position) > 0.1
    assert offset.tolist() == pytest.approx([10.0 * math.cos(moved.ego.yaw), 10.0 * math.sin(moved.ego.yaw)])
    assert perception.pose_covariance is not None
    assert np.diag(perception.pose_covariance).tolist() == pytest.approx([1.0, 1.0, math.radians(5.0) ** 2])
    assert not perception.has_exact_pose
    assert Perception(Nothing()).pose_covariance is None
