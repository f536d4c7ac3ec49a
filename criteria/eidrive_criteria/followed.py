"""Base class of criteria that follow one actor from frame to frame."""

from __future__ import annotations

from abc import abstractmethod

from eidrive_scenario.api.criteria import Continuity, Criterion, CriterionSettings, Frame, Step


class FollowedCriterion(Criterion):
    """Criterion on one actor. Its motion since the previous frame excludes absences and teleports."""

    def __init__(self, settings: CriterionSettings, of: str) -> None:
        super().__init__(settings)
        self.of = of
        self.subjects = (of,)
        self.was_present = False
        """Whether the actor was in a frame."""
        self._continuity = Continuity()

    def interrupt(self) -> None:
        """Forget the previous frame, after an absence or a teleport, and before the first frame."""

    @abstractmethod
    def follow(self, frame: Frame, row: int, step: Step | None) -> None:
        """Process a frame with the actor in a row. `step` is the motion since the previous frame; None without it."""

    def observe(self, frame: Frame) -> None:
        row = frame.view.rows.get(self.of)
        step = self._continuity.step(frame.view, row)
        if step is None:
            self.interrupt()
        if row is not None:
            self.was_present = True
            self.follow(frame, row, step)
