"""Compressed lidar point clouds in messages."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.v2x.messages.point_cloud import HEADER_BYTES, PointCloud, compress

COORDINATE = st.floats(-500.0, 500.0)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(COORDINATE, COORDINATE, st.floats(-5.0, 20.0)), max_size=60), st.sampled_from([0.05, 0.1, 1.0])
)
def test_compress_points_are_restored_within_half_a_cell(
    positions: list[tuple[float, float, float]], cell: float
) -> None:
    points = np.array(positions).reshape(-1, 3)
    restored = compress(points, 1.0, cell).points()
    assert len(restored) <= len(points)
    for point in points:
        assert np.abs(restored - point).max(axis=1).min() <= cell / 2 + 1e-9
    for point in restored:
        assert np.abs(points - point).max(axis=1).min() <= cell / 2 + 1e-9


def test_compress_steps_are_encoded_in_groups_of_seven_bits() -> None:
    """Cells 0, 1, 201 and 20201 of a row: steps 0, 1, 200 = 1·128 + 72 and 20000 = 1·128² + 28·128 + 32."""
    row = np.zeros((4, 3))
    row[:, 2] = [0.5, 1.5, 201.5, 20201.5]
    cloud = compress(row, 0.0, 1.0)
    assert cloud.steps.tolist() == [0, 1, 128 + 72, 1, 128 + 32, 128 + 28, 1]
    assert cloud.size == HEADER_BYTES + 7
    np.testing.assert_allclose(cloud.points(), row + np.array([0.5, 0.5, 0.0]))


def test_header_has_documented_layout() -> None:
    """Points in the cells (-2, 3, 0) and (0, 3, 1) of 500 mm: a grid of 3 x 1 x 2 cells, 0 and 5 are full."""
    data = compress(np.array([[-0.8, 1.6, 0.1], [0.2, 1.6, 0.7]]), 12.5, 0.5, duration=0.1).encode()
    assert struct.unpack_from("<d", data, 0) == (12.5,)
    assert struct.unpack_from("<H", data, 8) == (100,)
    assert struct.unpack_from("<3i", data, 10) == (-2, 3, 0)
    assert struct.unpack_from("<H", data, 22) == (500,)
    assert (data[24:27], data[27:30]) == (b"\x01\x00\x00", b"\x02\x00\x00")
    assert struct.unpack_from("<I", data, 30) == (2,)
    assert list(data[34:]) == [0, 5]


def test_compress_points_of_one_cell_become_one() -> None:
    assert len(compress(np.full((50, 3), 0.03), 0.0, 0.1).points()) == 1


def test_compress_without_points_has_header_size() -> None:
    cloud = compress(np.empty((0, 3)), 0.0, 0.1)
    assert cloud.points().shape == (0, 3)
    assert cloud.size == HEADER_BYTES


def test_compress_sweep_has_a_fifth_of_its_float_size() -> None:
    """5,000 points on a street of 100 m: three 32-bit floats each are 60 kB."""
    rng = generator(0, "sweep")
    points = np.stack([rng.uniform(-50, 50, 5000), rng.uniform(-50, 50, 5000), rng.uniform(0, 0.1, 5000)], axis=1)
    assert compress(points, 0.0, 0.1).size < 12_000


@pytest.mark.parametrize("cell", [0.05, 0.1, 0.2, 1.0])
@pytest.mark.parametrize("count", [0, 1, 500])
def test_decoded_cloud_equals_encoded_one(count: int, cell: float) -> None:
    cloud = compress(generator(0, "bytes").uniform(-300, 300, (count, 3)), 2.5, cell, 0.1004)
    data = cloud.encode()
    assert len(data) == cloud.size
    again = PointCloud.decode(data)
    np.testing.assert_array_equal(again.steps, cloud.steps)
    assert (again.time, again.corner, again.shape) == (cloud.time, cloud.corner, cloud.shape)
    assert again.duration == cloud.duration == 0.1
    np.testing.assert_array_equal(again.points(), cloud.points())
    with pytest.raises(ValueError, match="point"):
        PointCloud.decode(data[:31])
    with pytest.raises(ValueError, match="point"):
        PointCloud.decode(data + b"x")


@pytest.mark.parametrize(
    ("points", "steps"),
    [
        (0, [255]),
        (1, [1, 255]),
        (1, [*[255] * 9, 1]),
        (2, [*[255] * 8, 127, *[255] * 8, 127]),
    ],
)
def test_decode_steps_that_are_no_numbers_raises_error(points: int, steps: list[int]) -> None:
    """A step that does not end, one of more than 63 bits, and steps whose sum has more."""
    header = bytearray(compress(np.zeros((1, 3)), 0.0, 0.1).encode()[:HEADER_BYTES])
    header[-4:] = points.to_bytes(4, "little")
    with pytest.raises(ValueError, match="point"):
        PointCloud.decode(bytes(header) + bytes(steps))


def test_compress_rounds_cells_to_millimeters() -> None:
    assert compress(np.ones((1, 3)), 0.0, 0.1003).cell == 0.1
    assert compress(np.ones((1, 3)), 0.0, 1e-6).cell == 0.001


def test_recording_codec_preserves_point_cloud() -> None:
    cloud = compress(generator(0, "few").uniform(-5, 5, (20, 3)), 2.5, 0.1)
    kept = codec(PointCloud)
    again = kept.decode(kept.encode(cloud))
    np.testing.assert_array_equal(again.steps, cloud.steps)
    assert (again.time, again.corner, again.cell, again.shape) == (cloud.time, cloud.corner, cloud.cell, cloud.shape)


@pytest.mark.parametrize("cell", [0.05, 0.2])
def test_compress_is_independent_of_the_order_of_points(cell: float) -> None:
    points = generator(0, "order").uniform(-20, 20, (200, 3))
    np.testing.assert_array_equal(compress(points, 0, cell).steps, compress(points[::-1], 0, cell).steps)
