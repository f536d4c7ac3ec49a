"""Localization filter: closed forms, consistency on simulated drives, and effect on readings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace
from sample_car import CAR
from scipy.stats import chi2

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.perception.localization import (
    Estimate,
    InertialFilter,
    Localizer,
    MotionNoise,
    StartNoise,
)
from eidrive_scenario.sensing.readings import (
    CameraReading,
    EgoState,
    GnssReading,
    ImuReading,
    LidarReading,
    Readings,
    TruthReading,
)
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import GnssSettings, ImuSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement

DT = 0.05


def imu(acceleration: float = 0.0, turn: float = 0.0) -> ImuReading:
    return ImuReading(np.array([acceleration, 0.0, 0.0]), np.array([0.0, 0.0, turn]))


def ego(x: float, y: float, yaw: float, speed: float, time: float = 0.0) -> EgoState:
    return EgoState(time, np.array([x, y, 1.5]), yaw, 0.01, 0.02, speed, 0.0, 0.0)


def still(*state: float) -> Estimate:
    return Estimate(np.array(state), 1e-12 * np.eye(6))


def test_predict_constant_turn_rate_follows_circle() -> None:
    """10 m/s and 0.5 rad/s for pi seconds: a quarter of a circle of 20 m."""
    filter_ = InertialFilter(still(0, 0, 0, 10, 0, 0), MotionNoise())
    for _ in range(1000):
        filter_.predict(imu(turn=0.5), math.pi / 1000)
    np.testing.assert_allclose(filter_.estimate.state[:4], [20, 20, math.pi / 2, 10], atol=1e-4)


def test_predict_subtracts_biases() -> None:
    """2 s from rest: the accelerometer reads 1.1 with a bias of 0.1, the gyroscope reads its bias."""
    filter_ = InertialFilter(still(0, 0, 0, 0, 0.02, 0.1), MotionNoise())
    for _ in range(40):
        filter_.predict(imu(1.1, 0.02), DT)
    np.testing.assert_allclose(filter_.estimate.state, [2.0, 0, 0, 2.0, 0.02, 0.1], atol=1e-9)


def test_predict_covariance_grows_by_stated_noise() -> None:
    """At standstill for 4 s with white noise of density n, the variances of heading and speed are n² T."""
    noise = MotionNoise(
        ImuSettings(accelerometer_noise=0.05, gyroscope_noise=0.003, gyroscope_walk=0.0), slip=0.0, drift=0.0
    )
    filter_ = InertialFilter(still(0, 0, 0, 0, 0, 0), noise)
    for _ in range(80):
        filter_.predict(imu(), DT)
    covariance = filter_.estimate.covariance
    assert covariance[2, 2] == pytest.approx(0.003**2 * 4.0, rel=1e-3)
    assert covariance[3, 3] == pytest.approx(0.05**2 * 4.0, rel=1e-3)
    assert covariance[0, 0] == pytest.approx(0.05**2 * 4.0**3 / 3.0, rel=0.03)


@pytest.mark.parametrize("pitch", [0.0, -0.3])
def test_predict_covariance_follows_numerical_jacobian(pitch: float) -> None:
    """Without noise, the covariance follows the numerical Jacobian."""
    noise = MotionNoise(ImuSettings(accelerometer_noise=0.0, gyroscope_noise=0.0, gyroscope_walk=0.0), 0.0, 0.0)
    middle = np.array([3.0, -2.0, 0.7, 9.0, 0.01, 0.05])
    before = np.diag([0.3, 0.2, 0.01, 0.4, 1e-4, 1e-3])

    def moved(state: np.ndarray) -> np.ndarray:
        filter_ = InertialFilter(Estimate(state, before), noise)
        filter_.predict(imu(1.2, 0.3), 0.2, pitch)
        return filter_.estimate.state

    jacobian = np.stack([(moved(middle + n) - moved(middle - n)) / 2e-5 for n in 1e-5 * np.eye(6)], axis=1)
    filter_ = InertialFilter(Estimate(middle, before), noise)
    filter_.predict(imu(1.2, 0.3), 0.2, pitch)
    np.testing.assert_allclose(filter_.estimate.covariance, jacobian @ before @ jacobian.T, atol=1e-6)


def test_correct_weights_fix_by_covariance() -> None:
    """Prior variance 1, fix variance 3: a quarter of the innovation."""
    filter_ = InertialFilter(Estimate(np.zeros(6), np.eye(6)), MotionNoise())
    filter_.correct(GnssReading(np.array([4.0, -8.0, 99.0]), 3.0 * np.eye(3)))
    np.testing.assert_allclose(filter_.estimate.state[:2], [1.0, -2.0])
    np.testing.assert_allclose(np.diag(filter_.estimate.covariance)[:2], [0.75, 0.75])


def test_filter_nees_under_assumed_noise_is_within_chi_square_bounds() -> None:
    """Fifty drives with the assumed noise: NEES of x, y, yaw, speed and bias, 5 degrees of freedom.

    At each instant the mean over the runs is nearly always within the 99 % bounds of chi-square(250)/50, and so is its
    mean over time (Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2).
    """
    runs, ticks = 50, 300
    unit, start = ImuSettings(), StartNoise()
    noise = MotionNoise(unit, slip=0.0, drift=0.05)
    nees = np.zeros(ticks)
    for run in range(runs):
        rng = np.random.default_rng(500 + run)
        truth = np.array([0.0, 0.0, rng.uniform(-3, 3), 8.0])
        bias = rng.normal(0.0, unit.gyroscope_bias)
        deviations = np.array([start.position, start.position, start.yaw, start.speed, unit.gyroscope_bias, 1e-9])
        first = np.array([*truth, bias, 0.0]) + deviations * rng.standard_normal(6)
        first[4:] = 0.0
        filter_ = InertialFilter(Estimate(first, np.diag(deviations**2)), noise)
        for tick in range(ticks):
            push, turn = math.sin(0.03 * tick), 0.4 * math.sin(0.02 * tick + run)
            middle, mean = truth[2] + 0.5 * turn * DT, truth[3] + 0.5 * push * DT
            aside = noise.drift * math.sqrt(DT) * rng.standard_normal()
            cos, sin, distance = math.cos(middle), math.sin(middle), mean * DT
            truth += np.array(
                [distance * cos - aside * sin, distance * sin + aside * cos, turn * DT, push * DT + aside * turn]
            )
            bias += unit.gyroscope_walk * math.sqrt(DT) * rng.standard_normal()
            white = rng.standard_normal(2) / math.sqrt(DT)
            push_noise, turn_noise = unit.accelerometer_noise * white[0], unit.gyroscope_noise * white[1]
            filter_.predict(imu(push + push_noise, turn + bias + turn_noise), DT)
            if tick % 2 == 0:
                fix = np.array([*(truth[:2] + 0.3 * rng.standard_normal(2)), 0.0])
                filter_.correct(GnssReading(fix, 0.09 * np.eye(3)))
            state, covariance = filter_.estimate
            off = state[:5] - np.array([*truth, bias])
            off[2] = wrap_angle(float(off[2]))
            nees[tick] += off @ np.linalg.solve(covariance[:5, :5], off) / runs
    low, high = np.asarray(chi2.ppf([0.005, 0.995], 5 * runs)) / runs
    assert np.mean((nees > low) & (nees < high)) > 0.9
    assert low < nees.mean() < high


def effective_samples(series: np.ndarray) -> float:
    """Return the effective number of independent samples of the mean of (runs, ticks).

    It follows from the integrated correlation over time, up to its first zero (Sokal, Monte Carlo methods in
    statistical mechanics, 1997).
    """
    off = series - series.mean()
    ticks = series.shape[1]
    correlation = [float((off[:, lag:] * off[:, : ticks - lag]).mean()) for lag in range(ticks // 2)]
    vanishes = next((lag for lag, value in enumerate(correlation) if value <= 0.0), ticks // 2)
    return series.size / (1.0 + 2.0 * sum(correlation[1:vanishes]) / correlation[0])


@pytest.mark.statistical
def test_localizer_nees_in_simulated_world_is_within_chi_square_bounds() -> None:
    """Twelve drives of 20 s of the single-track model with tire slip, with simulated sensors.

    NEES of x, y, yaw and speed, 4 degrees of freedom, after 2 s. Neighboring instants are correlated: the mean over
    runs and time has the 99 % chi-square bounds of its effective number of samples. The position error is below that of
    a fix.
    """
    nees, errors = [], []
    for seed in range(12):
        sway = 0.01 * (seed % 10)
        unit = ImuSettings(accelerometer_bias=0.05)
        with World(None, dt=DT) as world:
            world.add(CAR, Placement(0, 0, speed=10.0), driven=True)
            rig = Rig(CAR, {"gnss": GnssSettings(), "imu": unit}, seed=seed)
            localizer = Localizer("Ego", seed, noise=MotionNoise(unit))
            for tick in range(400):
                readings = rig.read(world, world.view())
                localizer.with_estimated_pose(readings)
                state, covariance = localizer.estimate
                true = readings.ego
                off = np.array(
                    [*(state[:2] - true.position[:2]), wrap_angle(float(state[2]) - true.yaw), state[3] - true.speed]
                )
                if tick >= 40:
                    nees.append(off @ np.linalg.solve(covariance[:4, :4], off))
                    errors.append(float(np.hypot(off[0], off[1])))
                world.step({}, {"Ego": Control(0.12, 0.0, sway * math.sin(0.03 * tick))})
    draws = effective_samples(np.array(nees).reshape(12, -1))
    low, high = np.asarray(chi2.ppf([0.005, 0.995], 4 * draws)) / draws
    assert 20 < draws < 500, "a drive of 18 s has some independent samples, but not one per tick"
    assert low < np.mean(nees) < high
    assert np.sqrt(np.mean(np.square(errors))) < 0.6 * 0.3 * math.sqrt(2)


def test_initial_estimate_depends_on_seed_and_station() -> None:
    truth = Readings(0.0, ego(5.0, 6.0, 1.0, 3.0))
    starts = {
        (seed, name): Localizer(name, seed).with_estimated_pose(truth).ego.position.tolist()
        for seed in (1, 2)
        for name in ("Ego", "Other")
    }
    assert len({tuple(place) for place in starts.values()}) == 4
    again = Localizer("Ego", 1).with_estimated_pose(truth).ego.position.tolist()
    assert again == starts[1, "Ego"]
    draws = np.array(
        [Localizer("Ego", seed).with_estimated_pose(truth).ego.position[:2] - (5.0, 6.0) for seed in range(300)]
    )
    np.testing.assert_allclose(draws.std(axis=0), [0.5, 0.5], rtol=0.12)


def test_with_estimated_pose_moves_sensors_and_objects() -> None:
    """Sensors and objects keep their pose relative to the station; height and tilt stay true."""
    localizer = Localizer("Ego", 3)
    pose = np.eye(4)
    pose[:3, 3] = 6.0, 6.0, 2.0
    box = np.array([[15.0, 6.0, 0.7, 4.6, 1.8, 1.5, 1.0]])
    truth = Readings(
        0.0,
        ego(5.0, 6.0, 0.0, 3.0),
        TruthReading(("A",), ("car",), box, np.array([[2.0, 0.0]]), np.ones(1)),
        {
            "front": CameraReading(
                np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2), np.float32), np.zeros((2, 2), np.int32), np.eye(3), pose
            )
        },
        {"roof": LidarReading(np.ones((1, 3)), np.ones(1), pose)},
    )
    estimated = localizer.with_estimated_pose(truth)
    shift, turn = estimated.ego.position - truth.ego.position, estimated.ego.yaw
    assert np.linalg.norm(shift) > 0.01
    assert abs(turn) > 1e-4
    assert shift[2] == 0.0
    assert (estimated.ego.pitch, estimated.ego.roll) == (0.01, 0.02)
    cos, sin = math.cos(turn), math.sin(turn)
    for reading in (estimated.cameras["front"], estimated.lidars["roof"]):
        np.testing.assert_allclose(reading.pose[:3, 3] - estimated.ego.position, [cos, sin, 0.5], atol=1e-12)
        assert reading.pose[0, 0] == pytest.approx(cos)
    assert estimated.truth is not None
    np.testing.assert_allclose(
        estimated.truth.boxes[0, :2] - estimated.ego.position[:2], [10 * cos, 10 * sin], atol=1e-12
    )
    assert estimated.truth.boxes[0, 6] == pytest.approx(1.0 + turn)
    np.testing.assert_allclose(estimated.truth.velocity, [[2 * cos, 2 * sin]])


def test_localizer_between_fixes_follows_imu() -> None:
    """One fix per second, IMU readings in each tick: the estimate moves in each tick, at 10 m/s."""
    localizer = Localizer("Ego", 1, start=StartNoise(0.01, 1e-4, 0.01))
    xs = []
    for tick in range(40):
        time = tick * DT
        fix = GnssReading(np.array([10.0 * time, 0.0, 0.0]), 0.01 * np.eye(3)) if tick % 20 == 0 else None
        estimated = localizer.with_estimated_pose(
            Readings(time, ego(10.0 * time, 0.0, 0.0, 10.0, time), gnss=fix, imu=imu())
        )
        xs.append(float(estimated.ego.position[0]))
    np.testing.assert_allclose(np.diff(xs), 0.5, atol=0.05)


@pytest.mark.parametrize("pitch", [-0.2, 0.2])
def test_speed_on_slope_is_that_along_the_vehicle(pitch: float) -> None:
    """10 m/s at a pitch of 0.2 rad: x increases by 9.80 m/s. The 2 % are eight standard deviations of the speed."""
    localizer = Localizer("Ego", 1)
    for tick in range(200):
        time, x = tick * DT, 10.0 * math.cos(pitch) * tick * DT
        truth = replace(ego(x, 0.0, 0.0, 10.0, time), pitch=pitch)
        fix = GnssReading(np.array([x, 0.0, 0.0]), 0.01 * np.eye(3))
        estimated = localizer.with_estimated_pose(Readings(time, truth, gnss=fix, imu=imu()))
    assert math.sqrt(localizer.estimate.covariance[3, 3]) < 0.025
    assert estimated.ego.speed == pytest.approx(10.0, abs=0.02)


def test_localizer_of_a_station_that_enters_late_starts_at_its_first_reading() -> None:
    """The filter does not extrapolate the acceleration at the entry over the time before it."""
    starts = [
        Localizer("Ego", 1).with_estimated_pose(Readings(time, ego(5.0, 6.0, 1.0, 3.0, time), imu=imu(4.0, 0.2))).ego
        for time in (0.0, 6.0)
    ]
    np.testing.assert_array_equal(starts[0].position, starts[1].position)
    assert (starts[0].yaw, starts[0].speed) == (starts[1].yaw, starts[1].speed)


def test_localizer_after_teleport_starts_at_the_new_pose_with_a_new_error() -> None:
    """The IMU does not measure a teleport of 100 m: both errors have 0.5 m in each axis, 1 degree and 0.2 m/s, and are
    independent. The correlation of 300 independent pairs is below 0.2 in all but 0.05 % of samples."""
    poses = ego(5.0, 6.0, 1.0, 3.0), ego(5.0, 106.0, -2.0, 8.0, DT)
    errors = np.empty((2, 300, 4))
    for seed in range(300):
        localizer = Localizer("Ego", seed)
        for number, pose in enumerate(poses):
            estimated = localizer.with_estimated_pose(Readings(pose.time, pose, imu=imu())).ego
            x, y = estimated.position[:2] - pose.position[:2]
            errors[number, seed] = x, y, estimated.yaw - pose.yaw, estimated.speed - pose.speed
        assert not localizer.lagged_covariance.any()
    np.testing.assert_allclose(errors.std(axis=1), [[0.5, 0.5, math.radians(1.0), 0.2]] * 2, rtol=0.12)
    assert max(abs(np.corrcoef(*errors[:, :, axis])[0, 1]) for axis in range(4)) < 0.2


def test_estimate_before_first_reading_raises() -> None:
    with pytest.raises(ValueError, match="before the first reading"):
        Localizer("Ego", 1).estimate  # noqa: B018
