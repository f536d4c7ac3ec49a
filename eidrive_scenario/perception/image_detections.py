"""Detections in one camera image, before they are lifted to the world."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.arrays import Array


@dataclass(frozen=True)
class ImageDetections:
    """Detections of a network in an image: boxes (N, 4) x1 y1 x2 y2 [px], best first, and scores (N,)."""

    boxes: Array
    scores: Array
    classes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.boxes)
