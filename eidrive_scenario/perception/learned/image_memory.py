"""Results of earlier images, so that a series of runs draws and processes equal images once.

Runs of one seed that differ by messages have equal images until the vehicles drive differently.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

from numpy.typing import NDArray

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.sensing.readings import SignalReading

CAPACITY = 8192
"""Maximum number of stored results of each kind; the least recently used one is removed. One takes about a kilobyte."""

Key = tuple[Hashable, ...]
R = TypeVar("R")


class StationDetections(NamedTuple):
    """Result of a detector in one tick of a station."""

    images: Mapping[str, ImageDetections]
    signals: tuple[SignalReading, ...]
    objects: Detections


class RecentResults(Generic[R]):
    """Results by key; the least recently used one is removed when there are more than `capacity`."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._results: OrderedDict[Key, R] = OrderedDict()

    def __len__(self) -> int:
        return len(self._results)

    def get(self, key: Key) -> R | None:
        """Return a result; None if it is not stored."""
        result = self._results.get(key)
        if result is not None:
            self._results.move_to_end(key)
        return result

    def add(self, key: Key, result: R) -> None:
        """Store a result."""
        self._results[key] = result
        if len(self._results) > self._capacity:
            self._results.popitem(last=False)


class ImageMemory:
    """Results of images, all with read-only arrays.

    images    detections by network and pixels, and by network and digest of the image before it is drawn
    stations  result of a detector by everything that determines it
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self.images: RecentResults[ImageDetections] = RecentResults(capacity)
        self.stations: RecentResults[StationDetections] = RecentResults(capacity)


def read_only(*arrays: NDArray[Any]) -> None:
    """Make the arrays of a result read-only, as several runs share it."""
    for array in arrays:
        array.flags.writeable = False


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
