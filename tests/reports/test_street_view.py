"""Camera images of a recorded view."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from eidrive_reports.street_view import (
    HEIGHT,
    WIDTH,
    driver_view,
    helper_view,
    look_at,
    street_image,
)

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.actor import ActorSpec

Play = Callable[..., list[Frame]]

GREEN = (0.0, 0.8, 0.0)


def body(name: str, shape: str, size: tuple[float, float, float], color: tuple[float, float, float]) -> ActorSpec:
    return ActorSpec(name, shape, "car", size, (0.0, 0.0, 0.0), color=color)


def test_look_at_returns_upright_rotation_towards_target() -> None:
    pose = look_at((1.0, 2.0, 3.0), (5.0, 2.0, 0.0))
    rotation = pose[:3, :3]
    assert rotation.T @ rotation == pytest.approx(np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert rotation[:, 2] == pytest.approx([0.8, 0.0, -0.6])
    assert rotation[:, 0] == pytest.approx([0.0, -1.0, 0.0])
    assert rotation[2, 1] < 0.0
    assert pose[:3, 3] == pytest.approx([1.0, 2.0, 3.0])


def test_driver_view_is_along_heading(street: Play) -> None:
    view = street(None)[0].view
    forward = driver_view(view, "Incoming")[:3, 2]
    assert forward[:2] == pytest.approx([0.0, -1.0], abs=0.01)


def test_helper_view_is_towards_target(street: Play) -> None:
    view = street(None)[0].view
    pose = helper_view(view, "RSU", "Incoming")
    assert pose[:3, 3] == pytest.approx([42.2, -6.0, 3.1])
    offset = view.centers[1] - pose[:3, 3]
    assert pose[:3, 2] == pytest.approx(offset / np.linalg.norm(offset))


def test_street_image_shows_target_without_camera_actor(street: Play) -> None:
    view = street(None)[50].view
    bodies = {
        "Ego": body("Ego", "car", (4.892, 1.837, 1.49), (0.8, 0.0, 0.0)),
        "Incoming": body("Incoming", "car", (4.892, 1.837, 1.49), GREEN),
        "Truck": body("Truck", "truck", (8.468, 2.891, 3.827), (0.0, 0.0, 0.8)),
        "RSU": body("RSU", "rsu", (0.4, 0.4, 3.0), (0.5, 0.5, 0.5)),
    }
    png = street_image(bodies, None, view, helper_view(view, "RSU", "Incoming"), without="RSU", fov=30.0)
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (HEIGHT, WIDTH, 3)
    blue, green, red = np.moveaxis(image[200:340, 380:580].astype(int), -1, 0)
    assert np.mean((green > red + 25) & (green > blue + 25)) > 0.02
