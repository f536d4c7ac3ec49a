"""Base class of criteria on stop lines: number of illegal crossings by an actor."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal

from eidrive_criteria.folds import FollowedCriterion
from eidrive_scenario.api.common import RoadNetwork
from eidrive_scenario.api.criteria import (
    CriterionSettings,
    Crossing,
    Frame,
    Step,
    StopLineCrossings,
    Verdict,
    actor_never_present,
)


class StopLineSettings(CriterionSettings):
    """Settings: `{of: Ego, part: front}` with the part of the body that crosses the stop line."""

    of: str
    part: Literal["front", "rear"] = "front"


class StopLineCriterion(FollowedCriterion):
    """Criterion that fails at the first illegal crossing of a stop line."""

    needs_roads = True
    kind: ClassVar[Literal["light", "stop sign"]]
    offense: ClassVar[str]
    """Description of an illegal crossing for reasons, before the id of the signal."""

    def __init__(self, settings: StopLineSettings) -> None:
        super().__init__(settings, settings.of)
        self.part = settings.part
        self._before = (0.0, 0.0)
        """Crossing point in the previous frame."""
        self._passed = 0
        self._illegal: list[Crossing] = []

    def bind(self, roads: RoadNetwork | None) -> None:
        super().bind(roads)
        if roads is not None:
            self.crossings = StopLineCrossings(roads, self.kind)

    @abstractmethod
    def approach(self, frame: Frame, row: int, point: tuple[float, float]) -> None:
        """Process the state of signals near the crossing point, after the crossings of this frame."""

    @abstractmethod
    def is_illegal(self, crossing: Crossing) -> bool:
        """Return whether a crossing was illegal. Each crossing is passed once."""

    def interrupt(self) -> None:
        self.crossings.interrupt()

    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        view = frame.view
        x, y, _, length, _, _, yaw = view.plain_boxes[row]
        reach = length / 2.0 if self.part == "front" else -length / 2.0
        point = x + reach * math.cos(yaw), y + reach * math.sin(yaw)
        if step is not None:
            for crossing in self.crossings.crossings(self._before, point, yaw, view.time, view.states[row].z):
                self._passed += 1
                if self.is_illegal(crossing):
                    self._illegal.append(crossing)
        self.approach(frame, row, point)
        self._before = point

    def verdict(self) -> Verdict:
        first = self._illegal[0] if self._illegal else None
        if not self.was_present:
            reason = actor_never_present([self.of])
        elif first is not None:
            reason = f"{self.of} {self.offense} {first.signal} at {first.time:.2f} s"
        elif not self.crossings.lines:
            reason = f"the map has no {'traffic light' if self.kind == 'light' else self.kind}"
        else:
            reason = f"{self.of} passed {self._passed} stop lines, all legally"
        return self.conclude(
            self.was_present and first is None,
            reason,
            value=float(len(self._illegal)) if self.was_present else None,
            limit=0.0,
            first_violation=first.time if first is not None else None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the numbers of passed stop lines and of illegal crossings."""
        if not self.was_present:
            return {}
        return {f"{self.name}.passed": float(self._passed), f"{self.name}.count": float(len(self._illegal))}
