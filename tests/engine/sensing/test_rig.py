"""Sensor rig: rates, mounts, ego motion, camera and lidar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from pydantic import ValidationError

from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.sensor import mounting
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount, TruthSettings
from eidrive_scenario.world.camera import Pinhole


def test_rig_reads_sensor_at_its_rate(boxes: Any) -> None:
    """7 Hz at steps of 0.05 s: the first step at or after each multiple of 1/7 s."""
    rig = Rig(boxes.spec("Ego"), {"truth": TruthSettings(rate=7.0), "front": CameraSettings(width=4, height=3)})
    read = []
    for tick in range(40):
        view = boxes.view({"Ego": (0, 0, 0)}, time=tick * 0.05)
        readings = rig.read(boxes.scene(view), view)
        assert set(readings.cameras) == {"front"}
        if readings.truth is not None:
            read.append(tick)
    assert read == [math.ceil(k / 7.0 / 0.05 - 1e-9) for k in range(14)]


@pytest.mark.parametrize("rate", [5.0, 10.0, 20.0, 40.0])
def test_rig_keeps_rates_that_divide_step_exactly(boxes: Any, rate: float) -> None:
    rig = Rig(boxes.spec("Ego"), {"truth": TruthSettings(rate=rate)})
    read = [tick for tick in range(400) if rig.due(tick * 0.05)]
    assert read == list(range(0, 400, max(1, round(20 / rate))))


def test_rig_with_two_truth_sensors_raises(boxes: Any) -> None:
    with pytest.raises(ValueError, match="at most one sensor of kind 'truth'"):
        Rig(boxes.spec("Ego"), {"a": TruthSettings(), "b": TruthSettings()})


def test_rig_reads_ego_motion(boxes: Any) -> None:
    view = replace(
        boxes.view({"Ego": (1, 2, math.pi / 2)}, time=3.0),
        speed=np.array([4.0]),
        yaw_rate=np.array([0.2]),
        acceleration=np.array([[5.0, -1.5, 0.0]]),
    )
    ego = Rig(boxes.spec("Ego"), {}).read(boxes.scene(view), view).ego
    assert (ego.time, ego.yaw, ego.speed, ego.yaw_rate) == (3.0, math.pi / 2, 4.0, 0.2)
    assert ego.position.tolist() == [1.0, 2.0, 0.0]
    assert ego.acceleration == pytest.approx(-1.5)


def test_default_mounts_equal_ei_drive(boxes: Any) -> None:
    """Lincoln MKZ: front camera 2.5 m ahead and 1 m high, lidar 0.5 m behind the center, 1.9 m high."""
    spec = boxes.spec("Ego")
    front, lidar = mounting(CameraSettings(), spec, "front"), mounting(LidarSettings(), spec, "roof")
    assert (front.x, front.y, front.z, front.yaw) == pytest.approx((2.5, 0.0, 1.0, 0.0), abs=1e-3)
    assert (lidar.x, lidar.y, lidar.z) == pytest.approx((-0.5, 0.0, 1.9), abs=1e-3)
    left = mounting(CameraSettings(mount="left"), spec, "front")
    assert (left.y, left.z, math.degrees(left.yaw)) == pytest.approx((0.3, 1.8, 100.0), abs=1e-3)


def test_mount_accepts_list_and_name() -> None:
    assert CameraSettings.model_validate({"mount": [1, 0, 2.5, 30, 10]}).mount == Mount(
        x=1, y=0, z=2.5, yaw=30, pitch=10
    )
    assert CameraSettings.model_validate({"mount": "back"}).mount == "back"
    for invalid in ([1, 2], [1, 2, 3, 4, 5, 6], "bonnet"):
        with pytest.raises(ValidationError):
            CameraSettings.model_validate({"mount": invalid})


def test_camera_pose_and_intrinsics(boxes: Any) -> None:
    """A car and camera with heading north: right is east, down is down, forward is north."""
    view = boxes.view({"Ego": (10, 20, math.pi / 2)})
    scene = boxes.scene(view)
    rig = Rig(boxes.spec("Ego"), {"front": CameraSettings(width=800, height=600, fov=90.0)})
    reading = rig.read(scene, view).cameras["front"]
    np.testing.assert_allclose(reading.pose[:3, :3], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(reading.pose[:3, 3], [10, 22.5, 1.0], atol=1e-3)
    np.testing.assert_allclose(reading.intrinsics, [[400, 0, 400], [0, 400, 300], [0, 0, 1]])
    assert reading.rgb.shape == (600, 800, 3)
    assert scene.images[0][1] == Pinhole(800, 600, pytest.approx(400.0), 400.0, 300.0)  # type: ignore[arg-type]


def test_positive_pitch_turns_camera_down(boxes: Any) -> None:
    view = boxes.view({"Ego": (0, 0, 0)})
    rig = Rig(boxes.spec("Ego"), {"front": CameraSettings(mount=Mount(x=0, y=0, z=5, pitch=30), width=4, height=3)})
    forward = rig.read(boxes.scene(view), view).cameras["front"].pose[:3, 2]
    np.testing.assert_allclose(forward, [math.cos(math.pi / 6), 0, -0.5], atol=1e-12)


LIDAR = LidarSettings(channels=8, points_per_second=8000, rotation=20.0, range=30.0, range_noise=0.0)


def test_lidar_directions_in_one_period_are_one_revolution(boxes: Any) -> None:
    """8000 points/s on 8 rings at 20 Hz: 50 columns a revolution, one revolution in each step of 0.05 s."""
    view = boxes.view({"Ego": (0, 0, 0)})
    lidar = Rig(boxes.spec("Ego"), {"lidar": LIDAR}).due(0.0)["lidar"]
    assert isinstance(lidar, Lidar)
    first, second = lidar.directions(0.0), lidar.directions(0.05)
    assert first.shape == second.shape == (400, 3)
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), 1.0)
    np.testing.assert_allclose(first, second, atol=1e-9)
    elevations = np.unique(np.round(np.degrees(np.arcsin(first[:, 2])), 6))
    np.testing.assert_allclose(elevations, np.linspace(-30, 10, 8), atol=1e-6)
    assert lidar.directions(0.075).shape == (200, 3)
    assert view.time == 0.0


def test_lidar_points_are_on_ground_and_bodies(boxes: Any) -> None:
    view = boxes.view({"Ego": (5, -3, 0.8), "Other": (15, -3, 0)})
    scene = boxes.scene(view, ground=True)
    dense = LIDAR.model_copy(update={"points_per_second": 32000})
    cloud = Rig(boxes.spec("Ego"), {"lidar": dense}).read(scene, view).lidars["lidar"]
    world = cloud.world_points
    on_ground = np.abs(world[:, 2]) < 1e-6
    half = np.array([4.892, 1.837, 1.49]) / 2
    inside = np.all(np.abs(world - [15, -3, 0.745]) < half + 1e-6, axis=1)
    assert on_ground.sum() > 100
    assert inside.sum() > 3
    assert np.all(on_ground | inside)
    distance = np.linalg.norm(cloud.points, axis=1)
    assert distance.max() <= 30.0
    assert np.all((cloud.intensity > 0.0) & (cloud.intensity < 0.5))


def test_lidar_ego_body_hides_nearby_ground(boxes: Any) -> None:
    view = boxes.view({"Ego": (0, 0, 0)})
    settings = LIDAR.model_copy(update={"lower_fov": -80.0})
    cloud = Rig(boxes.spec("Ego"), {"lidar": settings}).read(boxes.scene(view, ground=True), view).lidars["lidar"]
    world = cloud.world_points
    assert len(world)
    assert not np.any((np.abs(world[:, 0]) < 2.446) & (np.abs(world[:, 1]) < 0.918))
