"""Decisions of planners: plans whose reason differs from that of the former plan."""

from __future__ import annotations

import re
from collections.abc import Iterator

from eidrive_scenario.driving.step import Plan
from eidrive_scenario.recording.frame import Frame

_NUMBER = re.compile(r"\d+(\.\d+)?")


class Decisions:
    """Fold over the frames of a run that finds new decisions."""

    def __init__(self) -> None:
        self._last: dict[str, str] = {}

    def new(self, frame: Frame) -> Iterator[tuple[str, Plan]]:
        """Yield stations and plans whose reason differs from that of the former plan in more than its numbers."""
        for name, step in frame.steps.items():
            if step.plan is None:
                continue
            decision = _NUMBER.sub("", step.plan.reason)
            if self._last.get(name) != decision:
                self._last[name] = decision
                yield name, step.plan
