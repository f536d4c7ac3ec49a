"""The smallest distance between two actors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from eidrive_criteria.pair import PairCriterion, PairSettings
from eidrive_scenario.api.common import WorldView, box_distance


class MinDistanceSettings(PairSettings):
    """`{of: Ego, to: Incoming, at_least: 1.5}` [m]; without `at_least` it measures and passes.

    measure  `box`: between the nearest points of the bodies, 0 if they touch, so that a crash fails every limit;
             `center`: between the centers of the bounding boxes in the horizontal plane (the metric of the EI-Drive
             paper), which stays above 0 in a crash
    """

    measure: Literal["center", "box"] = "box"


class MinDistance(PairCriterion):
    """Fails where two actors come closer than `at_least`; both distances [m] are metrics, whatever is judged."""

    settings_type = MinDistanceSettings
    name = "min_distance"
    unit = "m"

    def __init__(self, settings: MinDistanceSettings) -> None:
        super().__init__(settings)
        self._measure = settings.measure
        self._center = self._box = math.inf

    def measure(self, view: WorldView, of: int, to: int) -> float:
        a, b = view.plain_boxes[of], view.plain_boxes[to]
        center = math.hypot(b[0] - a[0], b[1] - a[1])
        box = center - (math.hypot(a[3], a[4]) + math.hypot(b[3], b[4])) / 2.0
        if view.contacts and any({contact.first, contact.second} == {self.of, self.to} for contact in view.contacts):
            box = 0.0  # Bodies that touched within the step may stand apart again at its end.
        elif box <= self._box:  # Else they are not as near as they have been, however they are turned.
            box = box_distance(a, b)
        self._center, self._box = min(self._center, center), min(self._box, box)
        return center if self._measure == "center" else box

    def words(self) -> str:
        measure = "center to center" if self._measure == "center" else "box to box"
        return f"{self.of} and {self.to} came within {self.smallest:.2f} m ({measure}) at {self.when:.2f} s"

    def metrics(self) -> Mapping[str, float]:
        """Both distances [m] and when the judged one was smallest [s]; nothing where the two never met."""
        if not math.isfinite(self.smallest):
            return {}
        pair = f"min_distance.{self.of}.{self.to}"
        return {f"{pair}.center": self._center, f"{pair}.box": self._box, f"{pair}.time": self.when}
