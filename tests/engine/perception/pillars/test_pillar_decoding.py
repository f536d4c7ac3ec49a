"""Objects in the output maps of the network `pillars`."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.learned.pillars.decode import MOST_OBJECTS, class_probability, decode

CELL = 0.8


def empty_maps(classes: int = 7) -> np.ndarray:
    maps = np.zeros((classes + 13, 128, 128), dtype=np.float32)
    maps[:classes] = -8.0
    return maps


def encode(
    maps: np.ndarray,
    box: tuple[float, ...],
    number: int,
    probability: float,
    displacement: tuple[float, float] = (0.0, 0.0),
    deviation: float = 0.5,
) -> tuple[int, int]:
    """Write a box x, y, height above the ground, length, width, height, heading into the cell of its center."""
    x, y, z, *sizes, yaw = box
    i, j = math.floor((x + 51.2) / CELL), math.floor((y + 51.2) / CELL)
    classes = len(maps) - 13
    maps[number, i, j] = math.log(probability / (1.0 - probability))
    maps[classes:, i, j] = [
        (x - ((i + 0.5) * CELL - 51.2)) / CELL,
        (y - ((j + 0.5) * CELL - 51.2)) / CELL,
        z,
        *(math.log(side) for side in sizes),
        math.cos(yaw),
        math.sin(yaw),
        math.cos(2.0 * yaw),
        math.sin(2.0 * yaw),
        *displacement,
        math.log(deviation),
    ]
    return i, j


@pytest.mark.parametrize("degrees", range(-180, 181, 15))
def test_decode_encoded_box_returns_it(degrees: int) -> None:
    box = (12.3, -7.77, 0.8, 4.6, 1.9, 1.6, math.radians(degrees))
    maps = empty_maps()
    encode(maps, box, 3, 0.7, (-3.0, 1.5), 0.4)
    objects = decode(maps, CELL, 0.5)
    np.testing.assert_allclose(objects.boxes[:, :6], [box[:6]], atol=1e-5)
    assert math.remainder(objects.boxes[0, 6] - box[6], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-5)
    np.testing.assert_allclose(objects.scores, [0.7], atol=1e-6)
    np.testing.assert_array_equal(objects.classes, [3])
    np.testing.assert_allclose(objects.displacement, [[-3.0, 1.5]])
    np.testing.assert_allclose(objects.deviation, [0.4], atol=1e-6)


@pytest.mark.parametrize("number", range(7))
@pytest.mark.parametrize("position", [(-51.2, -51.2), (51.15, 51.15), (-51.1, 50.9), (0.0, 0.0)])
def test_decode_classes_and_corners_of_grid(number: int, position: tuple[float, float]) -> None:
    maps = empty_maps()
    encode(maps, (*position, 1.0, 1.0, 1.0, 2.0, 0.3), number, 0.9)
    objects = decode(maps, CELL, 0.5)
    np.testing.assert_array_equal(objects.classes, [number])
    np.testing.assert_allclose(objects.boxes[:, :2], [position], atol=1e-5)


@pytest.mark.parametrize("degrees", [-170, -95, -80, 10, 85, 100, 179])
@pytest.mark.parametrize("error", [-60, 60])
def test_decode_axis_comes_from_twice_the_heading(degrees: int, error: int) -> None:
    """The heading itself is wrong by less than 90 degrees, so that it shows the front only."""
    maps, yaw = empty_maps(), math.radians(degrees)
    i, j = encode(maps, (5.0, 5.0, 0.8, 4.0, 2.0, 1.5, yaw), 0, 0.9)
    maps[13:15, i, j] = math.cos(yaw + math.radians(error)), math.sin(yaw + math.radians(error))
    heading = decode(maps, CELL, 0.5).boxes[0, 6]
    assert math.remainder(heading - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-5)


def test_decode_keeps_local_maxima_above_confidence_only() -> None:
    """A neighbor, also of another class, with a lower probability is the same object; one two cells away is another."""
    maps = empty_maps()
    box = (0.8, 4.0, 1.9, 1.6, 0.0)
    for x, y, number, probability in (
        (0.4, 0.4, 0, 0.9),
        (1.2, 1.2, 1, 0.8),
        (2.0, 2.0, 2, 0.7),
        (20.0, 20.0, 0, 0.49),
        (-20.0, 20.0, 6, 0.51),
    ):
        encode(maps, (x, y, *box), number, probability)
    objects = decode(maps, CELL, 0.5)
    np.testing.assert_allclose(objects.scores, [0.9, 0.51], atol=1e-6)
    np.testing.assert_array_equal(objects.classes, [0, 6])


def test_decode_empty_maps_returns_no_objects() -> None:
    objects = decode(empty_maps(), CELL, 0.5)
    assert objects.boxes.shape == (0, 7)
    assert objects.displacement.shape == (0, 2)
    assert len(objects.scores) == len(objects.classes) == len(objects.deviation) == 0


def test_decode_extreme_outputs_are_bounded() -> None:
    maps = empty_maps()
    maps[0] = 100.0
    maps[7:] = 1000.0
    objects = decode(maps, CELL, 0.5)
    assert len(objects.boxes) == MOST_OBJECTS
    assert np.isfinite(objects.boxes).all()
    assert objects.boxes[:, 3:6].max() == pytest.approx(math.exp(5.0))
    assert np.isfinite(objects.deviation).all()
    assert not len(decode(np.full_like(maps, np.nan), CELL, 0.5).boxes)


def test_class_probability_is_that_of_likeliest_class() -> None:
    maps = empty_maps()
    encode(maps, (0.4, 0.4, 0.8, 4.0, 1.9, 1.6, 0.0), 5, 0.75)
    probability = class_probability(maps)
    assert probability.dtype == np.float32
    assert probability[64, 64] == pytest.approx(0.75)
    assert probability[0, 0] == pytest.approx(1.0 / (1.0 + math.exp(8.0)))
    maps[0, 0, 0] = -1000.0
    maps[1:7, 0, 0] = -1000.0
    assert class_probability(maps)[0, 0] == 0.0
