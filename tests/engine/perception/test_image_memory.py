"""Detections of equal images: computed once per network, and equal to those without the memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.detector import LearnedDetector, SsdDetector, YoloDetector
from eidrive_scenario.perception.learned.image_memory import ImageMemory, RecentResults, StationDetections
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.rendering.renderer import ImageContent, Renderer
from eidrive_scenario.sensing.readings import CameraReading, DeferredImage, EgoState, LidarReading, Readings
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.world.camera import CameraImage, Radiance


@pytest.fixture
def memory() -> Iterator[ImageMemory]:
    held = ImageMemory(capacity=3)
    image_memory.activate(held)
    yield held
    image_memory.activate(None)


def network(confidence: float | None = None) -> ImageNetwork:
    from eidrive_scenario.perception.learned.network_loading import build_network

    return build_network("yolov5", LearnedSettings(confidence=confidence))


def image(value: int, width: int = 80) -> CameraReading:
    """Return a gray image without a digest."""
    rgb = np.full((60, width, 3), value, dtype=np.uint8)
    depth, segmentation = np.zeros((60, width), np.float32), np.zeros((60, width), np.int32)
    return CameraReading(rgb, depth, segmentation, np.eye(3), np.eye(4))


def processed_images(used: ImageNetwork, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """List that gets an entry for each image that a network processes from now on."""
    processed: list[int] = []
    original = type(used).candidates

    def candidates(self: ImageNetwork, pixels: NDArray[np.uint8]) -> Candidates:
        processed.append(1)
        return original(self, pixels)

    monkeypatch.setattr(type(used), "candidates", candidates)
    return processed


def test_equal_images_are_processed_once(memory: ImageMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = network(), network()
    processed = processed_images(first, monkeypatch)
    stored = first.find_in(image(10))
    assert second.find_in(image(10)) is stored
    assert len(processed) == 1
    assert not stored.boxes.flags.writeable
    first.find_in(image(11))
    first.find_in(image(10, width=40))
    assert len(processed) == 3, "another content and another size"
    network(confidence=0.7).find_in(image(10))
    assert len(processed) == 4, "another minimum confidence"


def test_least_recently_used_image_is_removed(memory: ImageMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    used = network()
    for value in (1, 2, 3, 1, 4):
        used.find_in(image(value))
    assert len(memory.images) == 3
    processed = processed_images(used, monkeypatch)
    for value in (1, 3, 4):
        used.find_in(image(value))
    assert processed == []
    used.find_in(image(2))
    assert processed == [1]


@pytest.mark.statistical
def test_runs_with_the_memory_have_the_same_trace() -> None:
    """The second arm differs by its messages only, and reuses the images before its vehicle drives differently."""
    plain = RunSettings(detector="yolov5", channel="ideal", time_limit=0.5)
    other = RunSettings(detector="yolov5", channel="none", time_limit=0.5)
    without = [run_file("coop/scenario_1", seed=1, settings=settings).trace_hash for settings in (plain, other)]
    held = ImageMemory()
    image_memory.activate(held)
    try:
        first = run_file("coop/scenario_1", seed=1, settings=plain).trace_hash
        stored = len(held.images)
        second = run_file("coop/scenario_1", seed=1, settings=other).trace_hash
    finally:
        image_memory.activate(None)
    assert [first, second] == without
    assert stored > 5
    assert len(held.images) == stored


def undrawn_image(number: int) -> DeferredImage:
    """Return an image that is never drawn, with the digest of its number."""

    def draw() -> CameraImage:
        raise AssertionError("no pixel is needed")

    return DeferredImage((64, 48), draw, lambda: content_digest(number))


def readings_of(
    number: int = 1,
    *,
    camera: dict[str, Any] | None = None,
    lidar: dict[str, Any] | None = None,
    time: float = 1.0,
    height: float = 0.0,
) -> Readings:
    lens = np.array([[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]])
    front = {"intrinsics": lens, "pose": np.eye(4), "distortion": np.zeros(5), **(camera or {})}
    values = {"points": np.ones((3, 3)), "intensity": np.ones(3), "pose": np.eye(4), "ring": np.zeros(3, np.int32)}
    cloud = LidarReading(**{**values, "azimuth": np.zeros(3), **(lidar or {})})
    ego = EgoState(time, np.array([0.0, 0.0, height]), 0.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    return Readings(time, ego, None, {"front": CameraReading.of(undrawn_image(number), **front)}, {"top": cloud})


OTHER_READINGS = [
    readings_of(2),
    readings_of(time=1.1),
    readings_of(height=0.2),
    *(readings_of(camera={name: value}) for name, value in [("intrinsics", np.eye(3)), ("distortion", np.ones(5))]),
    readings_of(camera={"pose": np.diag([1.0, 1.0, 1.0, 2.0])}),
    *(readings_of(lidar={name: np.full(3, 2.0)}) for name in ("intensity", "azimuth")),
    readings_of(lidar={"points": np.zeros((3, 3))}),
    readings_of(lidar={"pose": np.zeros((4, 4))}),
    readings_of(lidar={"ring": np.ones(3, np.int32)}),
    msgspec.structs.replace(readings_of(), lidars={}),
    msgspec.structs.replace(readings_of(), lidars={"roof": readings_of().lidars["top"]}),
    msgspec.structs.replace(readings_of(), cameras={"back": readings_of().cameras["front"]}),
]


def test_station_results_are_shared_for_equal_readings_only(
    memory: ImageMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each part of the readings that the detector uses belongs to the key."""
    processed = []

    def process(self: LearnedDetector, network: ImageNetwork, readings: Readings) -> StationDetections:
        processed.append(readings)
        return StationDetections({}, (), Detections(readings.time))

    monkeypatch.setattr(LearnedDetector, "_detect_objects", process)
    first, second = YoloDetector(), YoloDetector()
    stored = first.detect(readings_of())
    assert second.detect(readings_of()) is stored
    assert len(processed) == 1
    for number, readings in enumerate(OTHER_READINGS):
        second.detect(readings)
        assert len(processed) == 2 + number, number
    assert len(memory.stations) == 3
    SsdDetector().detect(readings_of())
    YoloDetector(LearnedSettings(confidence=0.7)).detect(readings_of())
    assert len(processed) == len(OTHER_READINGS) + 3


def test_images_are_drawn_once_in_runs_with_equal_images(memory: ImageMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    memory.images, memory.stations = RecentResults(100), RecentResults(100)
    drawn: list[int] = []
    original = Renderer.render

    def render(self: Renderer, content: ImageContent) -> Radiance:
        drawn.append(1)
        return original(self, content)

    monkeypatch.setattr(Renderer, "render", render)
    settings = RunSettings(detector="yolov5", channel="ideal", time_limit=0.3)
    first = run_file("coop/scenario_1", seed=1, settings=settings).trace_hash
    count = len(drawn)
    assert count > 3
    assert run_file("coop/scenario_1", seed=1, settings=settings).trace_hash == first
    assert len(drawn) == count


@pytest.mark.exhaustive
@pytest.mark.parametrize("weather", ["midnight", "foggy_morning"])
def test_order_of_runs_does_not_change_their_traces(weather: str) -> None:
    arms = [RunSettings(detector="ssd", channel=name, weather=weather, time_limit=0.3) for name in ("none", "ideal")]

    def traces(order: list[RunSettings]) -> list[str]:
        return [run_file("coop/scenario_2", seed=3, settings=settings).trace_hash for settings in order]

    without = traces(arms)
    image_memory.activate(ImageMemory())
    try:
        assert traces(arms[::-1]) == without[::-1]
        assert traces(arms) == without
    finally:
        image_memory.activate(None)
