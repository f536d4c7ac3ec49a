"""Storyboard of a run as intervals in which its elements were running."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from eidrive_scenario.storyboard.state.states import ElementState, StateChange


@dataclass
class _Element:
    """Element of the storyboard with the start, the end and the reason of each interval in which it was running."""

    kind: str
    intervals: list[list[Any]] = field(default_factory=list)


class Timeline:
    """Intervals in which the elements of a storyboard were running, by path, in the order of their first start."""

    def __init__(self) -> None:
        self._elements: dict[str, _Element] = {}
        self._changed: set[str] = set()

    def observe(self, changes: Iterable[StateChange]) -> None:
        """Add the changes of one frame."""
        for change in changes:
            if not math.isfinite(change.time):
                continue
            time = round(change.time, 4)
            starts = change.after is ElementState.RUNNING and change.before is not ElementState.RUNNING
            ends = change.before is ElementState.RUNNING and change.after is not ElementState.RUNNING
            if starts:
                element = self._elements.setdefault(change.path, _Element(change.kind))
                element.intervals.append([time, None, change.why, ""])
                self._changed.add(change.path)
            elif ends and change.path in self._elements:
                interval = self._elements[change.path].intervals[-1]
                interval[1], interval[3] = time, change.why
                self._changed.add(change.path)

    def take(self) -> list[list[Any]]:
        """Return [path, kind, intervals] of each element with a change since the last call.

        An interval is [start, end or None, reason of the start, of the end].
        """
        changed, self._changed = self._changed, set()
        if not changed:
            return []
        return [[path, found.kind, found.intervals] for path, found in self._elements.items() if path in changed]
