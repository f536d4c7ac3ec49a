"""A criterion passes or fails a run: a fold over frames, the same code live and over a recording."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from eidrive_scenario.recording.frame import Frame


@dataclass(frozen=True)
class Verdict:
    """What a criterion found. `value` and `limit` are in `unit`; `first_violation` is a time [s]."""

    name: str
    passed: bool
    value: float | None
    limit: float | None
    unit: str
    first_violation: float | None
    reason: str
    fatal: bool = False
    """True ends the run as soon as it fails."""


class Criterion(ABC):
    """Observes every frame of a run once, in order, then answers."""

    name: str

    @abstractmethod
    def observe(self, frame: Frame) -> None:
        """Take one frame into account."""

    @abstractmethod
    def verdict(self) -> Verdict:
        """The verdict over all frames so far; may be asked at any time."""
