"""Detections of one receiver in one frame, matched with the true objects, as compact codes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.detections import Detections
from eidrive_scenario.experiments.average_precision import match_by_share, matching_order
from eidrive_scenario.geometry import iou_bev, points_in_box
from eidrive_scenario.world.view import WorldView

OVERLAPS = (0.3, 0.5, 0.7)
"""Intersections over union in plan view from which a detection is correct."""
RANGES = (30.0, 50.0, 100.0)
"""Ends of the classes of the distance from the center of the ego [m]; farther objects are ignored."""
FULL_SCORE = 65535
ABOVE_GROUND = 0.2
"""Points lower than this above the base of a body are those of the ground [m]."""
_MARGIN = 0.1
"""Growth of a body on each side, for the noise of points on its surface [m]."""
_HIT_OVERLAP = 1
"""Index of the overlap for the second truth: bodies that any lidar hits."""

_SECOND = 3 * len(OVERLAPS)
"""Bit of the second truth in a code."""

Codes = NDArray[np.uint16]


@dataclass(frozen=True)
class Truth:
    """Road users in a frame.

    boxes   (M, 7) of all bodies except the ego, world frame
    place   (M,) class of the distance from the ego; len(RANGES) beyond the last one
    hit     (M,) whether a lidar of any station hits the body
    hidden  (M,) whether the lidar of the ego does not hit it, and that of another station does
    """

    boxes: Array
    place: Integers
    hit: Bools
    hidden: Bools

    @property
    def counted(self) -> Bools:
        """Whether each body is in range (M,)."""
        return self.place < len(RANGES)


class Tally(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Detections of one receiver over all frames of a run.

    scores    scores as 16-bit integers, best first within each frame, frames in order
    codes     16 bits per detection, see `sample_codes`
    hidden    number of found hidden objects, by overlap
    megabytes_per_second  sent over all links
    """

    scores: bytes
    codes: bytes
    hidden: tuple[int, ...]
    megabytes_per_second: float


class PerceptionRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Measurement of one run: numbers of frames and objects, and the detections by condition.

    objects  true objects by range; hit: by range, those that a lidar of any station hits; hidden: to the ego only
    """

    frames: int
    objects: tuple[int, ...]
    hit: tuple[int, ...]
    hidden: int
    tallies: dict[str, Tally]


def true_objects(view: WorldView, ego: str, clouds: dict[str, Array]) -> Truth:
    """Return the road users of a view except the ego. Masts and other objects at rest are no road users.

    clouds  points (N, 3) of the lidars of each station, world frame
    """
    rows = [row for name, row in view.rows.items() if name != ego and view.categories[row] != "misc"]
    boxes = view.boxes[rows].reshape(-1, 7)
    own = _hits(boxes, clouds[ego])
    others = np.zeros(len(boxes), dtype=bool)
    for name, points in clouds.items():
        if name != ego:
            others |= _hits(boxes, points)
    place = range_class(boxes, view.boxes[view.row(ego), :2])
    return Truth(boxes, place, own | others, others & ~own)


def range_class(boxes: Array, center: Array) -> Integers:
    """Return the range class (N,) of boxes by the distance of their centers."""
    place: Integers = np.searchsorted(np.array(RANGES), np.linalg.norm(boxes[:, :2] - center, axis=1))
    return place


def _hits(boxes: Array, points: Array) -> Bools:
    """Return whether at least one point is on each body (N,), as OPV2V lists objects."""
    found = np.zeros(len(boxes), dtype=bool)
    for row, (x, y, z, length, width, height, yaw) in enumerate(boxes.tolist()):
        near = points[np.abs(points[:, :2] - (x, y)).max(axis=1) < length]
        body = (x, y, z + ABOVE_GROUND / 2.0, length + _MARGIN, width + _MARGIN, height - ABOVE_GROUND + _MARGIN, yaw)
        found[row] = bool(points_in_box(near, np.array(body)).any())
    return found


def sample_codes(found: Detections, truth: Truth, center: Array) -> tuple[Codes, Codes, Integers]:
    """Return scores and codes (N,) of detections in the true world frame, and the found hidden objects by overlap.

    Code: for each overlap 1 bit for a correct detection and 2 bits for the range class, of the object of a correct
    detection or else of the detection itself; then 1 bit for correct and 1 bit for counted with the second truth. A
    detection beyond the last range, or of an object there, has the class len(RANGES) and does not count.
    """
    shares, confidence = iou_bev(found.boxes, truth.boxes), found.confidence
    order = matching_order(shares, confidence)
    own_place = range_class(found.boxes, center)[order]
    codes: Codes = np.zeros(len(found), dtype=np.uint16)
    hidden = np.zeros(len(OVERLAPS), dtype=np.int64)
    for number, least in enumerate(OVERLAPS):
        matches = match_by_share(shares, confidence, ~truth.counted, least)
        rows = matches.taken[matches.correct]
        place = np.where(matches.counted, own_place, len(RANGES))
        place[matches.correct] = truth.place[rows]
        codes |= _shifted(matches.correct, 3 * number) | _shifted(place, 3 * number + 1)
        hidden[number] = np.count_nonzero(truth.hidden[rows])
    second = match_by_share(shares, confidence, ~(truth.counted & truth.hit), OVERLAPS[_HIT_OVERLAP])
    counted = second.counted & (second.correct | (own_place < len(RANGES)))
    codes |= _shifted(second.correct, _SECOND) | _shifted(counted, _SECOND + 1)
    scores = np.rint(FULL_SCORE * np.clip(confidence[order], 0.0, 1.0)).astype(np.uint16)
    return scores, codes, hidden


def _shifted(values: NDArray[Any], bits: int) -> Codes:
    return (values.astype(np.uint16) << bits).astype(np.uint16)
