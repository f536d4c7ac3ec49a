"""Images of several stations in one batch: the results are those of separate calls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.detector import LearnedDetector, YoloDetector
from eidrive_scenario.perception.learned.image_memory import ImageMemory
from eidrive_scenario.perception.learned.image_network import Candidates
from eidrive_scenario.perception.learned.network_loading import build_network
from eidrive_scenario.perception.learned.own_network import OwnNetwork
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.perception.learned.weights import Precision
from eidrive_scenario.sensing.readings import CameraReading, EgoState, Readings
from eidrive_scenario.simulation import RunSettings, run_file

LENS = np.array([[400.0, 0.0, 256.0], [0.0, 400.0, 192.0], [0.0, 0.0, 1.0]])
AHEAD = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.5], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def images() -> Sequence[CameraReading]:
    """Images of both stations of scenario 1, with cars."""
    last: dict[int, CameraReading] = {}
    original = OwnNetwork.find_in

    def find_in(self: OwnNetwork, reading: CameraReading) -> ImageDetections:
        last[id(self)] = reading.at(AHEAD)
        return original(self, reading)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(OwnNetwork, "find_in", find_in)
        run_file("coop/scenario_1", seed=1, settings=RunSettings(detector="ssd", time_limit=2.0))
    assert len(last) == 2
    return list(last.values())


@pytest.fixture(params=[False, True], ids=["without memory", "with memory"])
def memory(request: pytest.FixtureRequest) -> Iterator[ImageMemory | None]:
    held = ImageMemory() if request.param else None
    image_memory.activate(held)
    yield held
    image_memory.activate(None)


def readings_of(time: float, **cameras: CameraReading) -> Readings:
    return Readings(time, EgoState(time, np.zeros(3), 0.0, 0.0, 0.0, 5.0, 0.0, 0.0), cameras=cameras)


def detector(**settings: float) -> YoloDetector:
    return YoloDetector(LearnedSettings(**settings))  # type: ignore[arg-type]


def calls_of(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """List that gets the number of images of each computation of a network from now on."""
    calls: list[int] = []
    original = OwnNetwork.candidates_of

    def candidates_of(self: OwnNetwork, pixels: list[NDArray[np.uint8]]) -> list[Candidates]:
        calls.append(len(pixels))
        return original(self, pixels)

    monkeypatch.setattr(OwnNetwork, "candidates_of", candidates_of)
    return calls


def assert_equal(found: Detections, expected: Detections) -> None:
    np.testing.assert_array_equal(found.boxes, expected.boxes)
    np.testing.assert_array_equal(found.scores, expected.scores)
    assert found.classes == expected.classes


@pytest.mark.exhaustive
def test_prepared_detectors_return_the_same_with_one_computation_per_network(
    images: Sequence[CameraReading], memory: ImageMemory | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two stations have equal settings, one another confidence, and one no camera reading in this tick."""
    first, second = images
    stations = [readings_of(1.0, front=first, rear=second), readings_of(1.0, front=second), readings_of(1.0, top=first)]
    settings = [{}, {}, {"confidence": 0.05}]
    expected = [detector(**own).detect(one) for own, one in zip(settings, stations, strict=True)]
    assert len(expected[0]) > 0
    if memory is not None:
        image_memory.activate(ImageMemory())
    calls = calls_of(monkeypatch)
    detectors = [detector(**own) for own in [*settings, {}]]
    YoloDetector.prepare_batch(detectors, [*stations, readings_of(1.0)])
    assert calls == [3, 1]
    for one, readings, wanted in zip(detectors, stations, expected, strict=False):
        assert_equal(one.detect(readings), wanted)
    assert calls == [3, 1]
    assert sorted(detectors[0].image_detections) == ["front", "rear"]


def test_prepared_images_are_used_once(images: Sequence[CameraReading]) -> None:
    """The next tick has other images; a tick without images of a station leaves none to the one after it."""
    first, second = images
    one = detector()
    expected = detector().detect(readings_of(2.0, front=second))
    YoloDetector.prepare_batch([one], [readings_of(1.0, front=first)])
    one.detect(readings_of(1.0, front=first))
    assert_equal(one.detect(readings_of(2.0, front=second)), expected)
    YoloDetector.prepare_batch([one], [readings_of(1.0, front=first)])
    YoloDetector.prepare_batch([one], [readings_of(1.5)])
    assert_equal(one.detect(readings_of(2.0, front=second)), expected)


def test_image_in_the_memory_is_not_computed_again(
    images: Sequence[CameraReading], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = images
    image_memory.activate(ImageMemory())
    try:
        calls = calls_of(monkeypatch)
        YoloDetector.prepare_batch([detector()], [readings_of(1.0, front=first)])
        YoloDetector.prepare_batch([detector(), detector()], [readings_of(2.0, a=second), readings_of(2.0, b=first)])
        YoloDetector.prepare_batch([detector()], [readings_of(3.0, c=second)])
    finally:
        image_memory.activate(None)
    assert [count for count in calls if count] == [1, 1]


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", ["yolov5", "ssd"])
def test_run_with_batches_has_the_same_trace(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a CPU, where an image is computed alone."""
    settings = RunSettings(detector=kind, time_limit=0.5)
    alone = run_file("coop/scenario_1", seed=1, settings=settings).trace_hash
    build = LearnedDetector.__init__

    def with_batches(self: LearnedDetector, settings: LearnedSettings | None = None) -> None:
        build(self, settings)
        self.processes_batches = True

    monkeypatch.setattr(LearnedDetector, "__init__", with_batches)
    calls = calls_of(monkeypatch)
    assert run_file("coop/scenario_1", seed=1, settings=settings).trace_hash == alone
    assert 2 in calls


@pytest.mark.parametrize("name", ["yolov5", "ssd"])
def test_integers_detect_the_same_objects(images: Sequence[CameraReading], name: str) -> None:
    pytest.importorskip("openvino", reason="needs the extra 'openvino'")
    single, integer = (
        build_network(name, LearnedSettings(runtime="openvino", precision=precision))
        for precision in get_args(Precision)
    )
    for reading in images:
        expected, detections = (
            sorted(zip(each.classes, each.boxes.tolist(), each.scores.tolist(), strict=True))
            for each in (single.find(reading.rgb), integer.find(reading.rgb))
        )
        assert [kind for kind, _, _ in detections] == [kind for kind, _, _ in expected]
        np.testing.assert_allclose([box for _, box, _ in detections], [box for _, box, _ in expected], atol=4.0)
        np.testing.assert_allclose([score for *_, score in detections], [score for *_, score in expected], atol=0.1)
