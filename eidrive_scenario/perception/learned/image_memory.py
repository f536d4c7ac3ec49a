"""Detections of earlier images, so that a series of runs processes equal images once.

Runs of one seed that differ by messages have equal images until the vehicles drive differently.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.image_detections import ImageDetections

CAPACITY = 8192
"""Maximum number of images; the least recently used one is removed. One takes about a kilobyte."""

Key = tuple[str, tuple[int, ...], bytes]


class ImageMemory:
    """Detections by network and image."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._found: OrderedDict[Key, ImageDetections] = OrderedDict()

    def __len__(self) -> int:
        return len(self._found)

    def get(self, key: Key) -> ImageDetections | None:
        """Return the detections of an image; None if they are not stored."""
        found = self._found.get(key)
        if found is not None:
            self._found.move_to_end(key)
        return found

    def add(self, key: Key, found: ImageDetections) -> None:
        """Store the detections of an image, whose arrays become read-only."""
        for array in (found.boxes, found.scores):
            array.flags.writeable = False
        self._found[key] = found
        if len(self._found) > self._capacity:
            self._found.popitem(last=False)


_active: ImageMemory | None = None


def active() -> ImageMemory | None:
    """Return the memory of this process; None if images are not stored."""
    return _active


def activate(memory: ImageMemory | None) -> None:
    """Store detections in this memory from now on, for all networks of this process with deterministic results.

    None ends it. A single run has no equal images, so it is off by default.
    """
    global _active
    _active = memory


def key_of(network: str, image: NDArray[np.uint8]) -> Key:
    """Return the key of an image; `network` identifies weights and settings."""
    return network, image.shape, hashlib.sha256(np.ascontiguousarray(image).data).digest()
