"""JSON text of frames: equal to the encoding of the codec, also for non-finite numbers and unusual types."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import ExecutedCommand, Frame
from eidrive_scenario.recording.json_text import JsonText
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world.appearance import Appearance, LightState
from eidrive_scenario.world.environment import Environment

MakeFrame = Callable[..., Frame]
TEXT = JsonText(Frame)


def check(frame: Frame) -> Any:
    """Compare text and decoded frame with the codec, number by number, and return the parsed text."""
    text = TEXT.encode(frame)
    parsed = json.loads(text)
    assert repr(parsed) == repr(codec(Frame).encode(frame))
    frames = [TEXT.decode(text), codec(Frame).decode(parsed)]
    assert repr(codec(Frame).encode(frames[0])) == repr(codec(Frame).encode(frames[1]))
    return parsed


@pytest.mark.parametrize("tick", range(5))
def test_text_of_frames_equals_codec(make_frame: MakeFrame, tick: int) -> None:
    check(make_frame(tick))


def with_plan(frame: Frame, **changes: Any) -> Frame:
    plan = frame.steps["Ego"].plan
    assert plan is not None
    return replace(frame, steps={**frame.steps, "Ego": replace(frame.steps["Ego"], plan=replace(plan, **changes))})


@pytest.mark.parametrize(("value", "spelled"), [(math.nan, "NaN"), (math.inf, "Infinity"), (-math.inf, "-Infinity")])
def test_non_finite_numbers_are_spelled(make_frame: MakeFrame, value: float, spelled: str) -> None:
    frame = make_frame(1)
    parsed = check(with_plan(frame, acceleration=value))
    assert parsed["steps"]["Ego"]["plan"]["acceleration"] == spelled
    points = np.array([[0.0, value], [1.0, 2.0]])
    parsed = check(with_plan(frame, points=points))
    assert parsed["steps"]["Ego"]["plan"]["points"][0] == [0.0, spelled]
    parsed = check(replace(frame, links=(LinkEvent("A", "B", 0, 0.0, "lost", None, "noise", 10, snr_db=value),)))
    assert parsed["links"][0]["snr_db"] == spelled


def test_sum_of_finite_numbers_that_overflows_is_finite(make_frame: MakeFrame) -> None:
    link = LinkEvent("A", "B", 0, 1.7e308, "delivered", 1.7e308, "", 10, path_loss_db=1.7e308)
    assert check(replace(make_frame(0), links=(link,)))["links"][0]["sent"] == 1.7e308


@pytest.mark.parametrize("number", [5e-324, 1.4084438767710081e-09, 1e16, 0.1 + 0.2, -0.0, 1.7976931348623157e308])
def test_numbers_keep_all_bits(make_frame: MakeFrame, number: float) -> None:
    frame = with_plan(make_frame(0), acceleration=number, points=np.array([[number, 1.0], [0.0, 0.0]]))
    again: Frame = codec(Frame).decode(json.loads(TEXT.encode(frame)))
    plan = again.steps["Ego"].plan
    assert plan is not None
    assert np.float64(plan.acceleration).tobytes() == np.float64(number).tobytes()
    assert plan.points[0, 0].tobytes() == np.float64(number).tobytes()


def test_array_that_changes_between_records_is_encoded_anew(make_frame: MakeFrame) -> None:
    points = np.array([[1.0, 2.0], [3.0, 4.0]])
    frame = with_plan(make_frame(0), points=points, speeds=points[:, 0])
    first = check(frame)
    points[0, 1] = 5.0
    assert check(frame)["steps"]["Ego"]["plan"]["points"] == [[1.0, 5.0], [3.0, 4.0]]
    assert first["steps"]["Ego"]["plan"]["points"] == [[1.0, 2.0], [3.0, 4.0]]


@pytest.mark.parametrize(
    "speeds",
    [
        np.array([0.0, 0.0]),
        np.array([0.0, -0.0]),
        np.array([0, 0]),
        np.array([False, False]),
        np.array([[0.0, 0.0]]),
        np.array([0.0, 9.0, 0.0, 9.0])[::2],
        np.zeros(2, dtype=">f8"),
        np.frombuffer(np.array([1.5, 0.0]).tobytes(), dtype=">f8"),
        np.array([0.0, 1.5], dtype=np.float32),
        np.linspace(0.0, 1.0, 5000),
    ],
)
def test_arrays_of_other_type_or_shape_are_distinguished(make_frame: MakeFrame, speeds: Any) -> None:
    check(with_plan(make_frame(0), speeds=np.array([1.5, 0.0]), points=np.zeros((1, 2))))
    check(with_plan(make_frame(0), speeds=speeds, points=np.zeros((1, 2))))


def test_other_mappings_and_scalars_of_numpy_are_encoded(make_frame: MakeFrame) -> None:
    signals: Mapping[str, str] = MappingProxyType({"1": "red", "Ä": "grün \u2028 \U0001f6a6"})
    light = Appearance({"lowBeam": LightState("lowBeam", "on", color=(0.5, 0.25, 0.0))})
    plan = Plan(np.zeros((2, 2), dtype=np.float32), np.zeros(0), "x", acceleration=np.float64(1.5))
    frame = with_plan(make_frame(0), acceleration=plan.acceleration, points=plan.points, speeds=plan.speeds)
    check(
        replace(
            frame,
            signals=signals,
            appearances={"Ego": light},
            environment=Environment(fog_range=math.inf, friction=0.5),
            monitors={"Seen": True},
            commands=(ExecutedCommand("exitSuccess", "text", 1.0),),
        )
    )


def test_type_without_encoding_raises_type_error() -> None:
    with pytest.raises(TypeError, match="no JSON encoding is defined"):
        JsonText(object)
