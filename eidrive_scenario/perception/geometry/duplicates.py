"""Removal of several boxes of one object, from several sensors of one station."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import iou_bev

SAME_OBJECT = 0.1
"""Overlap in plan view above which two boxes show one object (intersection over union): bodies do not overlap."""


def without_duplicates(detections: Detections) -> Detections:
    """Return the detections except those that overlap one with a higher score, in their order."""
    overlap = iou_bev(detections.boxes, detections.boxes)
    kept: list[int] = []
    for row in np.argsort(-detections.scores, kind="stable").tolist():
        if not kept or overlap[row, kept].max() <= SAME_OBJECT:
            kept.append(row)
    return detections.subset(sorted(kept))
