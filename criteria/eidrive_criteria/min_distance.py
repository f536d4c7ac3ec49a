"""The smallest distance between two actors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from eidrive_scenario.api import Criterion, CriterionSettings, Frame, Verdict, box_distance, never_appeared


class MinDistanceSettings(CriterionSettings):
    """`{of: Ego, to: Incoming, at_least: 3.5, measure: centre}`; without `at_least` it measures and passes.

    measure  `centre`: between the centres of the bounding boxes, seen from above (the metric of the EI-Drive paper);
             `box`: between the nearest points of the boxes, 0 where they touch
    """

    of: str
    to: str
    at_least: Annotated[float, Field(ge=0)] | None = None
    """[m]"""
    measure: Literal["centre", "box"] = "centre"


class MinDistance(Criterion):
    """Fails where two actors come closer than `at_least`; both distances [m] are metrics, whatever is judged."""

    settings_type = MinDistanceSettings
    name = "min_distance"

    def __init__(self, settings: MinDistanceSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of, settings.to)
        self._missing = set(self.subjects)
        self._centre = self._box = self._judged = math.inf
        self._when = math.nan
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self._missing:
            self._missing.difference_update(view.names)
        of, to = view.rows.get(self._settings.of), view.rows.get(self._settings.to)
        if of is None or to is None:
            return
        a, b = view.boxes[of].tolist(), view.boxes[to].tolist()
        pair = {self._settings.of, self._settings.to}
        # Bodies that touched within the step may stand apart again at its end.
        touched = any({contact.first, contact.second} == pair for contact in view.contacts)
        centre, box = math.hypot(b[0] - a[0], b[1] - a[1]), 0.0 if touched else box_distance(a, b)
        self._centre, self._box = min(self._centre, centre), min(self._box, box)
        judged = centre if self._settings.measure == "centre" else box
        if judged < self._judged:
            self._judged, self._when = judged, view.time
        limit = self._settings.at_least
        if self._violated is None and limit is not None and judged < limit:
            self._violated = view.time

    def verdict(self) -> Verdict:
        of, to, limit = self._settings.of, self._settings.to, self._settings.at_least
        measured = math.isfinite(self._judged)
        if measured:
            measure = "centre to centre" if self._settings.measure == "centre" else "box to box"
            reason = f"{of} and {to} came within {self._judged:.2f} m ({measure}) at {self._when:.2f} s"
        else:
            reason = never_appeared(self._missing) if self._missing else f"{of} and {to} were never there together"
        return Verdict(
            name=self.name,
            passed=measured and self._violated is None,
            value=self._judged if measured else None,
            limit=limit,
            unit="m",
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """Both distances [m] and when the judged one was smallest [s]; nothing where the two never met."""
        if not math.isfinite(self._judged):
            return {}
        pair = f"min_distance.{self._settings.of}.{self._settings.to}"
        return {f"{pair}.centre": self._centre, f"{pair}.box": self._box, f"{pair}.time": self._when}
