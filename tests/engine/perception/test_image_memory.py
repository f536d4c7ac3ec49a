"""Detections of equal images: computed once per network, and equal to those without the memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.image_memory import ImageMemory
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.simulation import RunSettings, run_file

pytest.importorskip("torch", reason="torch is not installed (pip install 'eidrive-scenario[learned]')")


@pytest.fixture
def memory() -> Iterator[ImageMemory]:
    held = ImageMemory(capacity=3)
    image_memory.activate(held)
    yield held
    image_memory.activate(None)


def network(confidence: float | None = None) -> ImageNetwork:
    from eidrive_scenario.perception.learned.detector import LearnedSettings, build_network

    return build_network("yolov5", LearnedSettings(confidence=confidence))


def image(value: int) -> NDArray[np.uint8]:
    return np.full((60, 80, 3), value, dtype=np.uint8)


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
    found = first.find(image(10))
    assert second.find(image(10)) is found
    assert len(processed) == 1
    assert not found.boxes.flags.writeable
    first.find(image(11))
    first.find(image(10)[:, :40])
    assert len(processed) == 3, "another content and another size"
    network(confidence=0.7).find(image(10))
    assert len(processed) == 4, "another minimum confidence"


def test_least_recently_used_image_is_removed(memory: ImageMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    used = network()
    for value in (1, 2, 3, 1, 4):
        used.find(image(value))
    assert len(memory) == 3
    processed = processed_images(used, monkeypatch)
    for value in (1, 3, 4):
        used.find(image(value))
    assert processed == []
    used.find(image(2))
    assert processed == [1]


def test_runs_with_the_memory_have_the_same_trace() -> None:
    """The second arm differs by its messages only, and reuses the images before its vehicle drives differently."""
    plain = RunSettings(detector="yolov5", channel="ideal", time_limit=0.5)
    other = RunSettings(detector="yolov5", channel="none", time_limit=0.5)
    without = [run_file("coop/scenario_1", seed=1, settings=settings).trace_hash for settings in (plain, other)]
    held = ImageMemory()
    image_memory.activate(held)
    try:
        first = run_file("coop/scenario_1", seed=1, settings=plain).trace_hash
        stored = len(held)
        second = run_file("coop/scenario_1", seed=1, settings=other).trace_hash
    finally:
        image_memory.activate(None)
    assert [first, second] == without
    assert stored > 5
    assert len(held) == stored
