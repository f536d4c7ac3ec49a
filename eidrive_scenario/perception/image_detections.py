"""Detections in one camera image, before they are lifted to the world."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.arrays import Array


@dataclass(frozen=True)
class ImageDetections:
    """What a network found in a picture: boxes (N, 4) x1 y1 x2 y2 [px of the picture], best first, scores (N,)."""

    boxes: Array
    scores: Array
    classes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.boxes)
