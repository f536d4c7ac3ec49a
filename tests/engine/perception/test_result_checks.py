"""Checks of the results and declarations of detectors and fusion methods."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.agent_factory import build_detector
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import InvalidResult, RegistryError
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.perception.result_checks import check_detections, checked_range, is_checked
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.settings import LidarSettings

BOX = np.array([[30.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]])


class Named(Detector):
    """Detector for the name of errors."""

    def detect(self, readings: Readings) -> Detections:
        return Detections(readings.time)


def detections(time: Any = 1.0, **fields: Any) -> Detections:
    usual: dict[str, Any] = {
        "boxes": BOX,
        "scores": np.ones(1),
        "classes": ("car",),
        "velocity": np.zeros((1, 2)),
        "covariance": np.zeros((1, 2, 2)),
    }
    return Detections(time, **{**usual, **fields})


@pytest.mark.parametrize(
    "found",
    [
        Detections(0.0),
        detections(),
        detections(velocity=np.full((1, 2), math.nan), covariance=np.full((1, 2, 2), math.nan)),
        detections(boxes=BOX.astype(np.float32), scores=np.ones(1, int), tracks=(np.int64(3),)),
        detections(boxes=BOX * [1e7, 1e7, 1, 0, 0, 0, 1]),
        detections(scores=np.array([1.0 + 1e-7]), existence=np.zeros(1)),
        detections(covariance=np.array([[[0.3, 0.1], [0.1, 1.0 / 30.0]]], np.float32)),
    ],
    ids=["empty", "usual", "unknown velocity", "other types", "far points", "rounded score", "singular covariance"],
)
def test_check_detections_accepts_finite_numbers(found: Detections) -> None:
    check_detections(Named(), "detect", found)


@pytest.mark.parametrize(
    ("make", "diagnostic"),
    [
        (lambda: detections(boxes=BOX * math.nan), "returned boxes with the value nan"),
        (lambda: detections(boxes=np.full((1, 7), -math.inf, np.float32)), "returned boxes with the value -inf"),
        (lambda: detections(boxes=BOX.astype(object)), "returned boxes as an array of type object"),
        (lambda: detections(boxes=BOX.astype(complex)), "returned boxes as an array of type complex128"),
        (lambda: detections(boxes=BOX.astype(str)), "returned boxes as an array of type <U32"),
        (lambda: detections(scores=np.array([-math.inf])), "returned scores with the value -inf"),
        (lambda: detections(velocity=np.full((1, 2), math.inf)), "returned velocity with the value inf"),
        (lambda: detections(covariance=np.full((1, 2, 2), math.inf)), "returned covariance with the value inf"),
        (lambda: detections(boxes=BOX * 1e200), "returned boxes with the value 3e+201 (expected -1e+09 to 1e+09)"),
        (lambda: detections(boxes=-BOX.astype(np.int64) * 10**11), "returned boxes with the value -3e+12"),
        (lambda: detections(boxes=BOX * -1), "returned a length, width or height with the value -4.5 (expected 0 to"),
        (lambda: detections(boxes=BOX * 1e5), "returned a length, width or height with the value 450000"),
        (lambda: detections(scores=np.array([-0.1])), "returned scores with the value -0.1 (expected 0 to 1)"),
        (lambda: detections(scores=np.array([95.0])), "returned scores with the value 95 (expected 0 to 1)"),
        (lambda: detections(existence=np.array([1.5])), "returned existence with the value 1.5"),
        (lambda: detections(velocity=np.array([[math.nan, 1e300]])), "returned velocity with the value 1e+300"),
        (lambda: detections(covariance=-np.ones((1, 2, 2))), "returned a variance with the value -1"),
        (lambda: detections(covariance=np.array([[[0.1, 0.05], [0, 0.1]]])), "returned covariance with the value [["),
        (lambda: detections(covariance=np.array([[[0.1, 0.3], [0.3, 0.1]]])), "returned covariance with the value [["),
        (lambda: detections(covariance=np.full((1, 2, 2), 1e300)), "returned covariance with the value 1e+300"),
        (lambda: detections(velocity_variance=np.array([-1.0])), "returned velocity_variance with the value -1"),
        (lambda: detections(velocity_variance=np.array([math.nan])), "returned velocity_variance with the value nan"),
        (lambda: detections(time=None), "returned time as None"),
        (lambda: detections(time=math.nan), "returned time with the value nan"),
        (lambda: detections(time="1"), "returned time as an object of type str"),
        (lambda: detections(classes=("dragon",)), "returned the class 'dragon'"),
        (lambda: detections(classes=([],)), "returned the class []"),
        (lambda: detections(tracks=("a",)), "returned the track 'a'"),
        (
            lambda: detections(tracks=(2**63,)),
            "returned the track 9223372036854775808 (expected",
        ),
        (lambda: None, "returned None"),
        (lambda: (), "returned an object of type tuple"),
    ],
)
def test_check_detections_refuses_invalid_results(make: Callable[[], Any], diagnostic: str) -> None:
    with pytest.raises(InvalidResult) as caught:
        check_detections(Named(), "detect", make())
    assert str(caught.value).startswith(f"detect {diagnostic}")


def test_check_detections_refuses_time_after_the_readings() -> None:
    check_detections(Named(), "detect", detections(time=0.3), now=0.3 - 5e-10)
    with pytest.raises(InvalidResult, match=r"detect returned the time 5\.3 s, which is later .* readings, 0\.3 s"):
        check_detections(Named(), "detect", detections(time=5.3), now=0.3)


def test_is_checked_for_derived_classes_of_third_parties() -> None:
    class Derived(OracleDetector):
        pass

    assert not is_checked(OracleDetector())
    assert is_checked(Derived())


@pytest.mark.parametrize("value", [None, -5.0, math.nan, "60"])
def test_checked_range_refuses_other_values_than_lengths(value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Named, "range_of", lambda *_: value)
    with pytest.raises(InvalidResult, match=r"range_of returned .* at least 0 m"):
        checked_range(Named(), LidarSettings())


@pytest.mark.parametrize(
    ("name", "value", "diagnostic"),
    [
        ("needs", "camera", "needs is 'camera'"),
        ("needs", frozenset({"sonar"}), r"needs is frozenset\({'sonar'}\)"),
        ("velocity_deviation", 0.0, r"velocity_deviation is 0\.0 \(expected a positive number or None\)"),
        ("velocity_deviation", "1", "velocity_deviation is '1'"),
        ("settings_type", dict, "settings_type is <class 'dict'>"),
    ],
)
def test_detector_class_with_invalid_declaration_is_error(
    name: str, value: object, diagnostic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(OracleDetector, name, value)
    with pytest.raises(RegistryError, match=rf"detector 'oracle' \(.*:OracleDetector\): {diagnostic}"):
        build_detector(AgentSettings(detector="oracle"))
