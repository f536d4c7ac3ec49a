"""Visible shares of objects, against angles and shadows calculated by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.geometry.projection import LidarView, in_camera, in_lidar
from eidrive_scenario.sensing.readings import CameraReading, LidarReading

NONE = np.empty((0, 7))


def camera(width: int = 800, height: int = 600, focal: float = 400.0) -> CameraReading:
    """Return a camera 1.5 m above the origin that points along x: 90 degrees wide."""
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = (0, -1, 0), (0, 0, -1), (1, 0, 0), (0, 0, 1.5)
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    shape = (height, width)
    return CameraReading(
        np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.float32), np.zeros(shape, np.int32), intrinsics, pose
    )


def lidar() -> LidarReading:
    pose = np.eye(4)
    pose[2, 3] = 2.0
    return LidarReading(np.empty((0, 3)), np.empty(0), pose)


def box(x: float, y: float, size: tuple[float, float, float] = (4.6, 1.85, 1.55), yaw: float = 0.0) -> np.ndarray:
    return np.array([[x, y, size[2] / 2.0, *size, yaw]])


def test_in_camera_object_ahead_is_in_full_view() -> None:
    assert in_camera(box(15, 0), camera(), NONE).tolist() == [1.0]


def test_in_camera_object_beside_or_behind_is_out_of_view() -> None:
    assert in_camera(np.concatenate([box(5, 12), box(-10, 0)]), camera(), NONE).tolist() == [0.0, 0.0]


def test_in_camera_object_cut_by_border_is_half_in_view() -> None:
    """The border is the line y = x: about half of the points of a car across it at (10, 10) are in view."""
    assert 0.3 <= in_camera(box(10, 10, yaw=math.pi / 2), camera(), NONE)[0] <= 0.7


def test_in_camera_object_behind_a_truck_is_hidden() -> None:
    truck = box(12, 0, (8.2, 2.6, 3.5), math.pi / 2)
    assert in_camera(box(25, 0), camera(), truck)[0] == 0.0
    assert in_camera(box(25, 14), camera(), truck)[0] == 1.0
    assert in_camera(truck, camera(), truck)[0] == 1.0, "an object does not hide itself"


@pytest.mark.parametrize(("scale", "reduction"), [(1, 1.0), (4, 0.25)])
def test_in_camera_small_object_is_out_of_view(scale: int, reduction: float) -> None:
    """1.55 m at focal length 400 px in the input of the network: 8 px high at 77 m, 20 px at 31 m."""
    lens = camera(scale * 800, scale * 600, scale * 400.0)
    shares = in_camera(np.concatenate([box(100, 0), box(50, 0), box(25, 0)]), lens, NONE, reduction)
    assert shares[0] == 0.0
    assert 0.0 < shares[1] < 1.0
    assert shares[2] == 1.0


def test_in_lidar_follows_field_of_view_range_and_shadow() -> None:
    half = math.radians(55.0)
    places = np.concatenate([box(20, 0), box(5, 20), box(60, 0)])
    assert in_lidar(places, lidar(), LidarView(half, range=50.0), NONE).tolist() == [1.0, 0.0, 0.0]
    assert in_lidar(places, lidar(), LidarView(range=100.0), NONE).tolist() == [1.0, 1.0, 1.0]
    assert in_lidar(box(20, 0), lidar(), LidarView(half, range=50.0), box(10, 0, (2.5, 8.0, 3.5)))[0] == 0.0


@pytest.mark.parametrize("angle", [0.4, 2.5])
def test_in_lidar_rotated_scene_has_equal_shares(angle: float) -> None:
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    scene, others = np.concatenate([box(12, 6), box(20, -2, yaw=0.7)]), box(14, -1.2, (4.0, 1.8, 2.5), 0.3)
    turned = [part.copy() for part in (scene, others)]
    for part in turned:
        part[:, :2] = part[:, :2] @ turn.T
        part[:, 6] += angle
    sensor = lidar()
    sensor.pose[:2, :2] = turn
    view = LidarView(0.5, range=50.0)
    straight = in_lidar(scene, lidar(), view, others)
    np.testing.assert_allclose(in_lidar(turned[0], sensor, view, turned[1]), straight)


def test_in_lidar_object_below_lowest_ring_is_out_of_view() -> None:
    """A mast of 6 m. Rays 30° downwards pass over a car 3 m away and show five of ten points of one 9 m away: those
    1.4 m high from 8.0 m on, those 0.8 m high from 9.1 m, and those 0.2 m high from 10.1 m."""
    mast, places = lidar(), np.concatenate([box(3, 0), box(9, 0), box(20, 0)])
    mast.pose[2, 3] = 6.0
    assert in_lidar(places, mast, LidarView(lowest=math.radians(-30.0)), NONE).tolist() == [0.0, 0.5, 1.0]


def test_in_lidar_of_pitched_lidar_follows_its_axis() -> None:
    """30° downwards from 6 m, the axis meets the ground at 10.4 m; rings up to 15° above it end at 22 m."""
    mast, (cos, sin) = lidar(), (math.cos(math.radians(30.0)), math.sin(math.radians(30.0)))
    mast.pose[:3, 0], mast.pose[:3, 2], mast.pose[2, 3] = (cos, 0.0, -sin), (sin, 0.0, cos), 6.0
    view = LidarView(lowest=math.radians(-15.0), highest=math.radians(15.0))
    assert in_lidar(np.concatenate([box(10, 0), box(30, 0)]), mast, view, NONE).tolist() == [1.0, 0.0]


def test_shares_without_boxes_are_empty() -> None:
    assert in_camera(NONE, camera(), box(5, 0)).shape == (0,)
    assert in_lidar(NONE, lidar(), LidarView(1.0, range=50.0), NONE).shape == (0,)
