"""Criterion: minimum distance between two actors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from eidrive_criteria.pairs import PairCriterion, PairSettings, has_contact
from eidrive_scenario.api.common import WorldView, box_distance


class MinDistanceSettings(PairSettings):
    """Settings: `{of: Ego, to: Incoming, at_least: 1.5}` [m]. Without `at_least` it only measures and passes.

    measure  `box`: between the nearest points of the bodies, 0 at contact, so that a crash violates every limit;
             `center`: between the centers of the bounding boxes in the horizontal plane (the metric of the EI-Drive
             paper), which remains above 0 in a crash
    """

    measure: Literal["center", "box"] = "box"


class MinDistance(PairCriterion):
    """Criterion that fails if two actors come closer than `at_least`.

    Both distances [m] are metrics, whichever is evaluated.
    """

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
        if has_contact(view, self.of, self.to):
            box = 0.0  # Bodies with a contact within the step may be apart at its end.
        elif box <= self._box:  # A larger lower bound cannot reduce the minimum.
            box = box_distance(a, b)
        self._center, self._box = min(self._center, center), min(self._box, box)
        return center if self._measure == "center" else box

    def describe_smallest(self) -> str:
        measure, other = "center to center", f"boxes within {self._box:.2f} m"
        if self._measure == "box":
            measure, other = "box to box", f"centers within {self._center:.2f} m"
        nearest = f"{self.of} and {self.to} came within {self.smallest:.2f} m ({measure}) at {self.when:.2f} s"
        return f"{nearest}, {other}"

    def metrics(self) -> Mapping[str, float]:
        """Return both minimum distances [m] and the time of the evaluated one [s]; empty without a common frame."""
        if not math.isfinite(self.smallest):
            return {}
        pair = f"min_distance.{self.of}.{self.to}"
        return {f"{pair}.center": self._center, f"{pair}.box": self._box, f"{pair}.time": self.when}
