"""Lifting of image boxes that no body fills, and of boxes near the border of the image."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from image_boxes import HEIGHT, WIDTH, box, camera, outline

from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings


def test_lift_takes_edges_near_border_as_those_of_image() -> None:
    """Networks place the edge of a cut object some pixels inside the border; as its own, the car would be small."""
    view = camera()
    target = box("car", 5.0, 4.2)
    edges = outline(target, view)
    assert edges[0] == 0.0
    found = lift(np.array([[4.0, *edges[1:]]]), ["car"], [1.0], view, time=0.0)
    off = found.boxes[0, :2] - target[:2]
    assert np.hypot(*off) < 1.5
    assert off @ np.linalg.solve(found.covariance[0], off) < 9.21


@pytest.mark.parametrize(
    ("name", "edges"),
    [
        pytest.param("truck", [300, 480, 460, 600], id="stripe_before_bumper"),
        pytest.param("car", [370, 520, 430, 560], id="arrow_on_road"),
        pytest.param("car", [380, 20, 420, 60], id="sign_above_road"),
    ],
)
def test_lift_box_that_no_body_fills_has_score_zero(name: str, edges: list[float]) -> None:
    """The horizon is at row 300, so what is below row 480 is less than 1.5 m - 0.45 d high at a distance d."""
    found = lift(np.array([edges, outline(box("car", 12, 0), camera())]), [name, "car"], [0.9, 0.8], camera(), time=0.0)
    assert found.scores.tolist() == [0.0, 0.8]


@pytest.mark.exhaustive
@pytest.mark.parametrize("size", [0.85, 1.0, 1.15])
@pytest.mark.parametrize("name", ["car", "truck", "pedestrian"])
def test_lift_bodies_of_unusual_size_keeps_scores(name: str, size: float) -> None:
    """Bodies up to two standard deviations from the mean size, near and far, whole and cut by the border."""
    view, rng = camera(), np.random.default_rng(4)
    edges: list[list[float]] = []
    while len(edges) < 60:
        reach, bearing = rng.uniform(3.0, 60.0), rng.uniform(-0.75, 0.75)
        target = box(name, reach * math.cos(bearing) + 3.0, reach * math.sin(bearing), rng.uniform(-3, 3))
        target[3:6] *= size
        target[2] = target[5] / 2.0
        left, top, right, bottom = outline(target, view, name)
        if right - left > 4.0 and bottom - top > 4.0:
            edges.append([left, top, right, bottom])
    found = lift(np.array(edges), [name] * 60, np.ones(60), view, time=0.0)
    assert found.scores.min() == 1.0


def test_lift_body_high_above_ground_has_score_zero(street: Any) -> None:
    """A car whose wheels are 4 m above the assumed ground; on the right ground points and image agree."""
    car = street.thing("Car", 15, 0)
    sensors = {"front": CameraSettings(width=WIDTH, height=HEIGHT), "roof": LidarSettings()}
    readings = street.readings([street.thing("Ego", 0, 0), car], sensors)
    view, cloud = readings.cameras["front"], readings.lidars["roof"]
    edges = np.array([outline(car.box, view)])
    assert lift(edges, ["car"], [0.7], view, time=0.0, ground=-4.0).scores.tolist() == [0.0]
    assert lift(edges, ["car"], [0.7], view, cloud, time=0.0).scores.tolist() == [0.7]


@pytest.mark.parametrize("place", [(12.0, -3.0), (20.0, -3.0), (30.0, 4.0), (12.0, -3.0, 0.3)])
def test_lift_van_that_detector_calls_car_is_placed_as_van(place: tuple[float, ...]) -> None:
    """Networks have one class for both. As a car, the van would be nearer and across the lane."""
    view, target = camera(), box("van", *place)
    edges = np.array([outline(target, view, "van")])
    found, same = (lift(edges, [name], [0.9], view, time=0.0) for name in ("car", "van"))
    assert found.classes == ("car",)
    np.testing.assert_allclose(found.boxes, same.boxes, atol=1e-6)
    off = found.boxes[0, :2] - target[:2]
    assert off @ np.linalg.solve(found.covariance[0], off) < 9.21


def test_lift_box_that_body_fills_poorly_has_large_covariance() -> None:
    """Half as wide and twice as high as a car: the edges are less exact than assumed, and so is the position."""
    view = camera()
    left, top, right, bottom = outline(box("car", 15.0, 0.0), view)
    narrow = [left + (right - left) / 4.0, top - (bottom - top), right - (right - left) / 4.0, bottom]
    usual, unusual = (
        lift(np.array([edges]), ["car"], [0.9], view, time=0.0).covariance[0]
        for edges in ([left, top, right, bottom], narrow)
    )
    assert (np.linalg.eigvalsh(unusual) > 3.0 * np.linalg.eigvalsh(usual)).all()
