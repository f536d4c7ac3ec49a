"""Contents of files that stay in the process, the least recently used of which are removed."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class KeptFiles(Generic[K, V]):
    """Values by key, up to a maximum size of their files in all [byte]."""

    def __init__(self, max_size: int) -> None:
        self._max_size = max_size
        self._kept: OrderedDict[K, tuple[V, int]] = OrderedDict()

    def get(self, key: K) -> V | None:
        """Return the value of a key, or None."""
        found = self._kept.get(key)
        if found is None:
            return None
        self._kept.move_to_end(key)
        return found[0]

    def put(self, key: K, value: V, size: int) -> None:
        """Store the value of a file of this size [byte]. Larger files than the maximum are not kept."""
        if size > self._max_size:
            return
        self._kept[key] = value, size
        self._kept.move_to_end(key)
        while sum(each for _, each in self._kept.values()) > self._max_size:
            self._kept.popitem(last=False)
