"""GNSS and IMU: exact oracle readings, noise and biases with the stated standard deviations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.sensing.inertial import Gnss, Imu
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import GnssSettings, ImuSettings

SCENE: Any = None
"""Neither sensor uses the scene."""


def gnss_errors(boxes: Any, ticks: int, seed: int = 1, step: float = 0.1, **settings: float) -> np.ndarray:
    receiver = Gnss(GnssSettings(**settings), boxes.spec("Ego"), seed=seed)  # type: ignore[arg-type]
    view = boxes.view({"Ego": (5.0, -3.0, 0.4)})
    readings = [receiver.read(SCENE, replace(view, time=k * step, tick=k), 0).position for k in range(ticks)]
    return np.array(readings) - (5.0, -3.0, 0.0)


def imu_errors(boxes: Any, ticks: int, seed: int = 1, step: float = 0.01, **settings: float) -> np.ndarray:
    unit = Imu(ImuSettings(**settings), boxes.spec("Ego"), seed=seed)  # type: ignore[arg-type]
    view = boxes.view({"Ego": (0.0, 0.0, 0.0)})
    readings = [unit.read(SCENE, replace(view, time=k * step, tick=k), 0) for k in range(1, ticks + 1)]
    return np.array([(*r.acceleration, *r.angular_rate) for r in readings])


def test_oracle_readings_are_exact(boxes: Any) -> None:
    view = replace(
        boxes.view({"Ego": (5.0, -3.0, math.pi / 2)}),
        acceleration=np.array([[0.0, 2.0, 0.0]]),
        yaw_rate=np.array([0.3]),
    )
    position = Gnss(GnssSettings(oracle=True), boxes.spec("Ego")).read(SCENE, view, 0).position
    np.testing.assert_array_equal(position, [5.0, -3.0, 0.0])
    imu = Imu(ImuSettings(oracle=True), boxes.spec("Ego")).read(SCENE, view, 0)
    np.testing.assert_allclose(imu.acceleration, [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(imu.angular_rate, [0.0, 0.0, 0.3], atol=1e-12)


def test_imu_on_slope_measures_in_body_frame(boxes: Any) -> None:
    """Nose up by 0.1 rad with acceleration along the slope: all of it is along the body."""
    view = replace(
        boxes.view({"Ego": (0.0, 0.0, 0.0)}),
        pitch=np.array([-0.1]),
        acceleration=np.array([[2.0 * math.cos(0.1), 0.0, 2.0 * math.sin(0.1)]]),
    )
    imu = Imu(ImuSettings(oracle=True), boxes.spec("Ego")).read(SCENE, view, 0)
    np.testing.assert_allclose(imu.acceleration, [2.0, 0.0, 0.0], atol=1e-12)


def test_gnss_noise_has_stated_deviation(boxes: Any) -> None:
    errors = gnss_errors(boxes, 4000, position_noise=0.3, height_noise=0.6)
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * np.array([0.3, 0.3, 0.6]) / math.sqrt(4000))
    np.testing.assert_allclose(errors.std(axis=0), [0.3, 0.3, 0.6], rtol=4 / math.sqrt(8000))
    assert abs(np.corrcoef(errors[1:, 0], errors[:-1, 0])[0, 1]) < 4 / math.sqrt(4000)


def test_gnss_covariance_contains_noise_and_initial_bias(boxes: Any) -> None:
    settings = GnssSettings(position_noise=0.3, height_noise=0.6, bias=0.4)
    reading = Gnss(settings, boxes.spec("Ego")).read(SCENE, boxes.view({"Ego": (0.0, 0.0, 0.0)}), 0)
    np.testing.assert_allclose(reading.covariance, np.diag([0.25, 0.25, 0.36]))


def test_gnss_bias_has_stated_initial_value_and_random_walk(boxes: Any) -> None:
    """Over runs the initial bias has a standard deviation of 2 m, and its change after 25 s 0.2 m/√s · √25 s = 1 m."""
    starts, changes = [], []
    for seed in range(300):
        errors = gnss_errors(
            boxes, 6, seed=seed, step=5.0, position_noise=0.0, height_noise=0.0, bias=2.0, bias_walk=0.2
        )
        starts.append(errors[0, :2])
        changes.append(errors[5, :2] - errors[0, :2])
    margin = 4 / math.sqrt(2 * 600)
    assert np.std(starts) == pytest.approx(2.0, rel=margin)
    assert np.std(changes) == pytest.approx(1.0, rel=margin)


def test_imu_noise_scales_with_sampling_rate(boxes: Any) -> None:
    """0.02 m/s²/√Hz at 100 Hz is 0.2 m/s², at 25 Hz half of that."""
    flat: dict[str, Any] = {"gyroscope_bias": 0.0, "gyroscope_walk": 0.0}
    fast = imu_errors(boxes, 4000, step=0.01, accelerometer_noise=0.02, gyroscope_noise=0.001, **flat)
    slow = imu_errors(boxes, 4000, step=0.04, accelerometer_noise=0.02, gyroscope_noise=0.001, **flat)
    margin = 5 / math.sqrt(2 * 4000)
    np.testing.assert_allclose(fast[1:].std(axis=0), [0.2] * 3 + [0.01] * 3, rtol=margin)
    np.testing.assert_allclose(slow[1:].std(axis=0), [0.1] * 3 + [0.005] * 3, rtol=margin)


def test_imu_bias_is_constant_with_stated_deviation(boxes: Any) -> None:
    without_noise: dict[str, Any] = {"accelerometer_noise": 0.0, "gyroscope_noise": 0.0, "gyroscope_walk": 0.0}
    runs = [
        imu_errors(boxes, 2, seed=s, accelerometer_bias=0.1, gyroscope_bias=0.01, **without_noise) for s in range(300)
    ]
    assert all(np.array_equal(run[0], run[1]) for run in runs)
    first = np.array([run[0] for run in runs])
    margin = 4 / math.sqrt(2 * 900)
    assert first[:, :3].std() == pytest.approx(0.1, rel=margin)
    assert first[:, 3:].std() == pytest.approx(0.01, rel=margin)


def test_gnss_draws_depend_on_seed_station_and_tick_only(boxes: Any) -> None:
    first, again, other = (gnss_errors(boxes, 5, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    receiver = Gnss(GnssSettings(), boxes.spec("Ego"), seed=1)
    view = boxes.view({"Ego": (5.0, -3.0, 0.4)})
    late = receiver.read(SCENE, replace(view, time=0.4, tick=4), 0).position - (5.0, -3.0, 0.0)
    np.testing.assert_array_equal(late, first[4])


def test_rig_reads_gnss_and_imu_at_their_rates(boxes: Any) -> None:
    rig = Rig(boxes.spec("Ego"), {"gnss": GnssSettings(rate=10.0), "imu": ImuSettings()}, seed=3)
    for tick in range(6):
        view = boxes.view({"Ego": (0.0, 0.0, 0.0)}, time=tick * 0.05)
        readings = rig.read(boxes.scene(view), view)
        assert readings.imu is not None
        assert (readings.gnss is not None) == (tick % 2 == 0)
    with pytest.raises(ValueError, match="at most one sensor of kind 'gnss'"):
        Rig(boxes.spec("Ego"), {"a": GnssSettings(), "b": GnssSettings()})
