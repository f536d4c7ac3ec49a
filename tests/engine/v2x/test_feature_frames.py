"""Frames of feature maps: bytes, and their distribution over frames."""

from __future__ import annotations

import contextlib
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.v2x.messages.feature_frames import HEADER_BYTES, FeatureFrame, split, to_cells

INDICES = np.array([3, 258, 16383])
CODES = np.array([[-127] * 3, [0, 1, -1], *([[5, 6, 7]] * 5), [127] * 3], dtype=np.int8)


def frame(encoding: str = "int8", count: int = 3, **more: Any) -> FeatureFrame:
    random = generator(0, "frame")
    indices = random.permutation(16384)[:count] if count != 3 else INDICES
    codes = np.resize(CODES.T, (count, 8)).T if encoding == "int8" else np.arange(count, dtype=np.uint8)
    given = {
        "station": 0x01020304, "sequence": 258, "number": 0, "count": 1, "time": 12.5, "x": 100.25, "y": -3.0,
        "yaw": 0.5, "interval": 0.25, "foot": 0.75, "cell": 0.8, "shape": (128, 128), "encoding": encoding,
        "scale": 0.0625, "cells": to_cells(indices, codes),
    }  # fmt: skip
    return FeatureFrame(**{**given, **more})


def test_header_has_documented_layout() -> None:
    """Little-endian, without padding; the tables of docs/cooperative_perception.md list the same offsets."""
    data = frame().encode()
    assert data[0] == 1
    assert data[1:5] == bytes([4, 3, 2, 1])
    assert struct.unpack_from("<3H", data, 5) == (258, 0, 1)
    assert struct.unpack_from("<3d", data, 11) == (12.5, 100.25, -3.0)
    assert struct.unpack_from("<4f", data, 35) == (0.5, 0.25, 0.75, float(np.float32(0.8)))
    assert struct.unpack_from("<2H", data, 51) == (128, 128)
    assert data[55] == 0
    assert struct.unpack_from("<f", data, 56) == (0.0625,)
    assert struct.unpack_from("<H", data, 60) == (3,)
    assert len(data) == 62 + 3 * 10


def test_cells_are_index_and_codes() -> None:
    cells = frame().encode()[HEADER_BYTES:]
    assert cells[:10] == bytes([3, 0, 129, 0, 5, 5, 5, 5, 5, 127]), "-127 is 129 in two's complement"
    assert cells[10:12] == bytes([2, 1]), "258 = 1 * 256 + 2"
    assert cells[20:22] == bytes([255, 63])
    short = frame("codes").encode()[HEADER_BYTES:]
    assert short == bytes([3, 0, 0, 2, 1, 1, 255, 63, 2])


@pytest.mark.parametrize("encoding", ["int8", "codes"])
@pytest.mark.parametrize("count", [0, 1, 3, 133, 16384])
def test_decoded_frame_equals_encoded_one(encoding: str, count: int) -> None:
    sent = frame(encoding, count)
    data = sent.encode()
    assert len(data) == sent.size
    again = FeatureFrame.decode(data)
    assert again.encode() == data
    assert (again.cell, again.yaw, again.shape) == (sent.cell, sent.yaw, sent.shape)
    np.testing.assert_array_equal(again.indices, sent.indices)
    if encoding == "int8":
        np.testing.assert_array_equal(again.integers, np.resize(CODES.T, (count, 8)).T)
    else:
        np.testing.assert_array_equal(again.codes, np.arange(count, dtype=np.uint8))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=120))
def test_arbitrary_bytes_are_an_error_or_a_frame(data: bytes) -> None:
    with contextlib.suppress(ValueError):
        assert FeatureFrame.decode(data).encode() == data


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 91), st.integers(0, 255))
def test_changed_byte_is_an_error_or_another_frame(offset: int, value: int) -> None:
    data = bytearray(frame().encode())
    data[offset] = value
    with contextlib.suppress(ValueError):
        assert FeatureFrame.decode(bytes(data)).encode() == bytes(data)


@pytest.mark.parametrize(
    "change",
    [
        {"time": np.nan}, {"x": np.inf}, {"y": 1e12}, {"yaw": np.nan}, {"cell": 0.0}, {"scale": -1.0},
        {"shape": (0, 5)}, {"shape": (300, 300)}, {"number": 1}, {"shape": (2, 2)},
    ],
)  # fmt: skip
def test_frame_with_invalid_header_is_an_error(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"frame|cell|grid"):
        FeatureFrame.decode(frame(**change).encode())


@pytest.mark.parametrize(("encoding", "cells"), [("int8", 133), ("codes", 446)])
def test_frames_are_filled_up_to_the_limit(encoding: str, cells: int) -> None:
    """(1400 - 62) / 10 = 133.8 and (1400 - 62) / 3 = 446."""
    whole = frame(encoding, 1000)
    parts = split(whole, 1400)
    assert [len(part.cells) for part in parts[:-1]] == [cells] * (len(parts) - 1)
    assert max(part.size for part in parts) <= 1400
    assert [(part.number, part.count) for part in parts] == [(row, len(parts)) for row in range(len(parts))]
    np.testing.assert_array_equal(np.concatenate([part.indices for part in parts]), whole.indices)
    assert all(FeatureFrame.decode(part.encode()).shape == (128, 128) for part in parts)


def test_limit_below_header_leaves_one_cell_per_frame() -> None:
    assert [len(part.cells) for part in split(frame(), 10)] == [1, 1, 1]


def test_recording_codec_preserves_frame() -> None:
    kept = codec(FeatureFrame)
    assert kept.decode(kept.encode(frame())).encode() == frame().encode()
