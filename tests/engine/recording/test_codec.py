"""Lossless JSON encoding."""

import json
from dataclasses import dataclass
from typing import Any, Literal

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.storyboard.state.element_states import ElementState


def round_trip(kind: Any, value: Any) -> Any:
    text = json.dumps(codec(kind).encode(value), allow_nan=False)
    return codec(kind).decode(json.loads(text))


@given(st.floats())
def test_codec_of_float_keeps_all_bits(number: float) -> None:
    assert np.float64(round_trip(float, number)).tobytes() == np.float64(number).tobytes() or np.isnan(number)


def test_codec_of_non_finite_numbers_follows_protobuf() -> None:
    assert codec(float).encode(float("-inf")) == "-Infinity"
    assert np.isnan(round_trip(float, float("nan")))
    array = np.array([[np.nan, np.inf], [-np.inf, -0.0]])
    assert codec(NDArray[np.float64]).encode(array) == [["NaN", "Infinity"], ["-Infinity", -0.0]]
    assert round_trip(NDArray[np.float64], array).tobytes() == array.tobytes()


@pytest.mark.parametrize("shape", [(0, 7), (0,), (0, 2, 2), (3, 0)])
def test_codec_of_empty_array_keeps_shape(shape: tuple[int, ...]) -> None:
    again = round_trip(NDArray[np.float64], np.empty(shape))
    assert again.shape == shape
    assert again.dtype == np.float64


def test_codec_of_integer_array_keeps_dtype() -> None:
    rows = np.array([[1, -1]], dtype=np.int32)
    again = round_trip(NDArray[np.int32], rows)
    assert again.dtype == np.int32
    assert np.array_equal(again, rows)


def test_codec_of_each_supported_type_is_lossless() -> None:
    assert round_trip(ElementState, ElementState.RUNNING) is ElementState.RUNNING
    assert round_trip(float | None, None) is None
    assert round_trip(tuple[str, ...], ("a", "b")) == ("a", "b")
    assert round_trip(tuple[float, int], (1.5, 2)) == (1.5, 2)
    assert round_trip(frozenset[str], frozenset({"b", "a"})) == {"a", "b"}
    assert round_trip(dict[str, tuple[int, ...]], {"a": (1,)}) == {"a": (1,)}
    assert round_trip(Literal["x", "y"], "x") == "x"


@pytest.mark.parametrize("value", ["z", {"x": 1}, ["x"], None, 1])
def test_codec_of_literal_refuses_other_values(value: object) -> None:
    with pytest.raises(ValueError, match="is none of x, y"):
        codec(Literal["x", "y"]).decode(value)


def test_codec_of_missing_field_uses_default() -> None:
    @dataclass(frozen=True)
    class Newer:
        old: int
        new: float = 2.5

    assert codec(Newer).decode({"old": 1}) == Newer(1, 2.5)
    assert codec(Newer).schema["required"] == ["old"]


def test_codec_of_unsupported_type_raises_type_error() -> None:
    with pytest.raises(TypeError, match="no JSON encoding is defined"):
        codec(complex)


def test_schema_of_frame_contains_all_fields() -> None:
    schema = codec(Frame).schema
    assert set(schema["properties"]) == {f.name for f in msgspec.structs.fields(Frame)}
    station = schema["properties"]["steps"]["additionalProperties"]
    assert station["properties"]["outbox"]["items"]["properties"]["sender"] == {"type": "string"}


def test_codec_of_existence_and_plan_objects_accepts_older_files() -> None:
    found = Detections(
        0.5,
        np.zeros((1, 7)),
        np.ones(1),
        ("car",),
        np.zeros((1, 2)),
        np.zeros((1, 2, 2)),
        existence=np.array([0.1 + 0.2]),
    )
    assert round_trip(Detections, found).existence.tolist() == [0.1 + 0.2]
    text = codec(Detections).encode(found)
    del text["existence"]
    assert codec(Detections).decode(text).existence.shape == (0,)
    plan = codec(Plan).encode(Plan(np.zeros((2, 2)), np.zeros(2), "", objects=(1, 3)))
    assert codec(Plan).decode(plan).objects == (1, 3)
    del plan["objects"]
    assert codec(Plan).decode(plan).objects == ()
