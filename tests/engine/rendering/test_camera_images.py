"""Tests of camera images: pixel, depth and label of known points."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from camera_image import camera_image
from sample_car import CarFactory

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

WIDTH, HEIGHT, FOV = 320, 240, math.radians(80)
FOCAL = WIDTH / 2 / math.tan(FOV / 2)


def camera_pose(x: float, y: float, z: float, yaw: float = 0.0) -> np.ndarray:
    """Return the pose of a level camera with a heading."""
    pose = np.eye(4)
    pose[:3, 0] = (math.sin(yaw), -math.cos(yaw), 0.0)
    pose[:3, 1] = (0.0, 0.0, -1.0)
    pose[:3, 2] = (math.cos(yaw), math.sin(yaw), 0.0)
    pose[:3, 3] = (x, y, z)
    return pose


@pytest.fixture
def crate() -> ActorSpec:
    """Box of 1 m."""
    return ActorSpec("Crate", "box", "misc", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5), color=(0.9, 0.1, 0.1))


def test_box_covers_expected_pixels(world: World, crate: ActorSpec) -> None:
    world.add(crate, Placement(10.0, 2.0))
    picture = camera_image(world, camera_pose(0.0, 0.0, 1.2), WIDTH, HEIGHT, FOV)
    rows, columns = np.nonzero(picture.segmentation == 0)
    # The front face spans y 1.5 to 2.5 and z 0 to 1 at a depth of 9.5 m; left in the world is left in the image. The
    # right side is visible too, up to the rear edge at 10.5 m.
    left, right = WIDTH / 2 - FOCAL * 2.5 / 9.5, WIDTH / 2 - FOCAL * 1.5 / 10.5
    top, bottom = HEIGHT / 2 + FOCAL * 0.2 / 10.5, HEIGHT / 2 + FOCAL * 1.2 / 9.5
    assert columns.min() == pytest.approx(left, abs=1.0)
    assert columns.max() + 1 == pytest.approx(right, abs=1.0)
    assert rows.min() == pytest.approx(top, abs=1.0)
    assert rows.max() + 1 == pytest.approx(bottom, abs=1.0)
    assert picture.rgb[rows, columns].mean(axis=0)[0] > picture.rgb[rows, columns].mean(axis=0)[1] + 20


def test_depth_at_the_center_is_exact_to_a_centimeter(world: World, crate: ActorSpec) -> None:
    # The mesh of the crate has battens along its edges, and its faces are 6 cm inside.
    for distance in (5.0, 20.0, 60.0):
        world.step({"Crate": Placement(distance + 0.5, 0.0)}, {}) if "Crate" in world.names else world.add(
            crate, Placement(distance + 0.5, 0.0)
        )
        picture = camera_image(world, camera_pose(0.0, 0.0, 0.5), WIDTH + 1, HEIGHT + 1, math.radians(40))
        assert picture.depth[HEIGHT // 2, WIDTH // 2] == pytest.approx(distance + 0.06, abs=0.01)
    assert picture.depth.dtype == np.float32


def test_depth_of_the_ground_equals_geometry(world: World) -> None:
    picture = camera_image(world, camera_pose(0.0, 0.0, 1.5), WIDTH, HEIGHT, FOV)
    row = 200
    # Ground without roads is 6 cm below zero; the center of pixel row 200 points down by (200.5 - 120) / f.
    assert picture.depth[row, WIDTH // 2] == pytest.approx(1.56 * FOCAL / (row + 0.5 - HEIGHT / 2), rel=0.01)
    assert np.isinf(picture.depth[10]).all()
    assert (picture.segmentation == -1).all()


def test_segmentation_has_rows_of_nearest_actors(world: World, crate: ActorSpec, car: CarFactory) -> None:
    world.add(car("Behind"), Placement(20.0, 0.0, yaw=math.pi / 2))
    world.add(crate, Placement(8.0, 0.5))
    world.add(car("Aside"), Placement(15.0, -6.0))
    picture = camera_image(world, camera_pose(0.0, 0.5, 0.8), WIDTH, HEIGHT, FOV)
    assert picture.segmentation[HEIGHT // 2 + 2, WIDTH // 2] == 1
    assert set(np.unique(picture.segmentation)) == {-1, 0, 1, 2}
    hidden = camera_image(world, camera_pose(0.0, 0.5, 0.8), WIDTH, HEIGHT, FOV, ignore=("Crate",))
    assert hidden.segmentation[HEIGHT // 2 + 2, WIDTH // 2] == 0
    assert 1 not in hidden.segmentation


def test_segmentation_rows_are_updated_after_removal(world: World, crate: ActorSpec, car: CarFactory) -> None:
    world.add(car("First"), Placement(12.0, 5.0))
    world.add(crate, Placement(8.0, 0.0))
    camera_image(world, camera_pose(0.0, 0.0, 0.5), 64, 48, FOV)
    world.remove("First")
    picture = camera_image(world, camera_pose(0.0, 0.0, 0.5), 64, 48, FOV)
    assert set(np.unique(picture.segmentation)) == {-1, 0}
    # A new body with a former name is drawn again.
    world.remove("Crate")
    world.add(replace(crate, size=(1.0, 3.0, 1.0)), Placement(8.0, 0.0))
    wider = camera_image(world, camera_pose(0.0, 0.0, 0.5), 64, 48, FOV)
    assert (wider.segmentation == 0).sum() > 2 * (picture.segmentation == 0).sum()


def test_camera_images_are_deterministic(car: CarFactory) -> None:
    def take() -> bytes:
        with World(picture_maker=picture_maker) as world:
            world.add(car("A"), Placement(8.0, 1.0, yaw=0.4))
            world.add_building("House", (30.0, -10.0, 5.0), (10.0, 10.0, 10.0))
            picture = camera_image(world, camera_pose(0.0, 0.0, 1.4), 160, 120, FOV)
            return picture.rgb.tobytes() + picture.depth.tobytes() + picture.segmentation.tobytes()

    assert take() == take()
