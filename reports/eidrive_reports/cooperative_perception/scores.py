"""Average precision and recall over the records of several runs, with jackknife intervals over the runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.api.common import Array, Bools, Integers, WorldView, iou_bev, points_in_box
from eidrive_scenario.api.driving import Detections
from eidrive_scenario.api.experiments import area_in_order, jackknife_interval, match_by_share, matching_order, wilson

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

_SECOND = len(OVERLAPS)
"""Variant of the second truth in a code, after the overlaps."""

Codes = NDArray[np.uint16]


@dataclass(frozen=True)
class Truth:
    """Road users in a frame.

    boxes          (M, 7) of all bodies except the ego, world frame
    range_classes  (M,) class of the distance from the ego; len(RANGES) beyond the last one
    hit            (M,) whether a lidar of any station hits the body
    hidden         (M,) whether the lidar of the ego does not hit it, and that of another station does
    """

    boxes: Array
    range_classes: Integers
    hit: Bools
    hidden: Bools

    @property
    def counted(self) -> Bools:
        """Whether each body is in range (M,)."""
        return self.range_classes < len(RANGES)


class Tally(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Detections of one receiver over all frames of a run.

    scores    scores as 16-bit integers, best first within each frame, frames in order
    codes     16 bits per detection, see `sample_codes`
    hidden    number of detected hidden objects, by overlap and range
    megabytes_per_second  sent over all links
    """

    scores: bytes
    codes: bytes
    hidden: tuple[tuple[int, ...], ...]
    megabytes_per_second: float


class PerceptionRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Measurement of one run: numbers of frames and objects, and the detections by condition.

    objects  true objects by range; hit: those that a lidar of any station hits; hidden: to the ego only
    """

    frames: int
    objects: tuple[int, ...]
    hit: tuple[int, ...]
    hidden: tuple[int, ...]
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
    classes = range_classes(boxes, view.boxes[view.row(ego), :2])
    return Truth(boxes, classes, own | others, others & ~own)


def range_classes(boxes: Array, center: Array) -> Integers:
    """Return the range class (N,) of boxes by the distance of their centers."""
    classes: Integers = np.searchsorted(np.array(RANGES), np.linalg.norm(boxes[:, :2] - center, axis=1))
    return classes


def _hits(boxes: Array, points: Array) -> Bools:
    """Return whether at least one point is on each body (N,), as OPV2V lists objects."""
    hits = np.zeros(len(boxes), dtype=bool)
    for row, (x, y, z, length, width, height, yaw) in enumerate(boxes.tolist()):
        near = points[np.abs(points[:, :2] - (x, y)).max(axis=1) < length]
        body = (x, y, z + ABOVE_GROUND / 2.0, length + _MARGIN, width + _MARGIN, height - ABOVE_GROUND + _MARGIN, yaw)
        hits[row] = bool(points_in_box(near, np.array(body)).any())
    return hits


def sample_codes(detections: Detections, truth: Truth, center: Array) -> tuple[Codes, Codes, Integers]:
    """Return scores and codes (N,) of detections in the true world frame, and the number of detected hidden objects by
    overlap and range.

    Code: for each overlap, and then for the second truth, 1 bit for a correct detection and 2 bits for the range class,
    of the object of a correct detection or else of the detection itself. A detection beyond the last range, or of an
    object that does not count, has the class len(RANGES) and does not count.
    """
    shares, confidence = iou_bev(detections.boxes, truth.boxes), detections.confidence
    order = matching_order(shares, confidence)
    own_classes = range_classes(detections.boxes, center)[order]
    codes: Codes = np.zeros(len(detections), dtype=np.uint16)
    hidden = np.zeros((len(OVERLAPS), len(RANGES)), dtype=np.int64)
    variants = [(least, truth.counted) for least in OVERLAPS]
    variants.append((OVERLAPS[_HIT_OVERLAP], truth.counted & truth.hit))
    for number, (least, counted) in enumerate(variants):
        matches = match_by_share(shares, confidence, ~counted, least)
        rows = matches.taken[matches.correct]
        classes = np.where(matches.counted, own_classes, len(RANGES))
        classes[matches.correct] = truth.range_classes[rows]
        codes |= _shifted(matches.correct, 3 * number) | _shifted(classes, 3 * number + 1)
        if number < len(OVERLAPS):
            hidden[number] = np.bincount(truth.range_classes[rows[truth.hidden[rows]]], minlength=len(RANGES))
    scores = np.rint(FULL_SCORE * np.clip(confidence[order], 0.0, 1.0)).astype(np.uint16)
    return scores, codes, hidden


def _shifted(values: NDArray[Any], bits: int) -> Codes:
    return (values.astype(np.uint16) << bits).astype(np.uint16)


@dataclass(frozen=True)
class Precision:
    """Average precision with its 95 % interval.

    low, high  jackknife over the runs; NaN for a single one
    local      average precision of detections in the order of the frames, sorted within a frame only
    objects    number of true objects
    left_out   average precision without each of the runs
    """

    value: float
    low: float
    high: float
    local: float
    objects: int
    left_out: tuple[float, ...]


@dataclass(frozen=True)
class HiddenRecall:
    """Share of the objects hidden to the ego that are detected, at any score, with its 95 % interval over the runs."""

    value: float
    low: float
    high: float
    detected: int
    objects: int


class Pool:
    """Detections of one condition in all runs, frames in order; those of the first `reach` range classes count."""

    def __init__(self, records: Sequence[PerceptionRecord], condition: str, reach: int = len(RANGES)) -> None:
        self._records = records
        self._reach = reach
        tallies = [record.tallies[condition] for record in records]
        self._tallies = tallies
        codes = [np.frombuffer(tally.codes, dtype="<u2") for tally in tallies]
        self._codes = np.concatenate(codes).astype(np.int64)
        self._scores = np.concatenate([np.frombuffer(tally.scores, dtype="<u2") for tally in tallies]).astype(np.int64)
        self._run = np.repeat(np.arange(len(records)), [len(part) for part in codes])

    @property
    def megabytes_per_second(self) -> float:
        """Mean size of the sent messages per second over the runs."""
        return float(np.mean([tally.megabytes_per_second for tally in self._tallies]))

    def precision(self, overlap: int, range_class: int | None = None) -> Precision:
        """Return the average precision at an overlap of OVERLAPS, in one range class or in all."""
        objects = [self._total(record.objects, range_class) for record in self._records]
        return self._precision(overlap, range_class, objects)

    def precision_of_hit_objects(self) -> Precision:
        """Return the average precision at the overlap 0.5 for objects that a lidar of any station hits."""
        return self._precision(_SECOND, None, [self._total(record.hit) for record in self._records])

    def _total(self, counts: Sequence[int], range_class: int | None = None) -> int:
        return sum(counts[: self._reach]) if range_class is None else counts[range_class]

    def _precision(self, variant: int, range_class: int | None, objects: Sequence[int]) -> Precision:
        """Return the average precision by the bits of a variant of the truth in the codes."""
        correct = self._codes >> (3 * variant) & 1 == 1
        classes = self._codes >> (3 * variant + 1) & 3
        kept = classes < self._reach if range_class is None else classes == range_class
        local = area_in_order(correct[kept], sum(objects))
        order = np.flatnonzero(kept)
        order = order[np.argsort(-self._scores[order], kind="stable")]
        right, scores, run = correct[order], self._scores[order], self._run[order]
        value = area_in_order(right, sum(objects), scores)
        left_out = [
            area_in_order(right[run != number], sum(objects) - count, scores[run != number])
            for number, count in enumerate(objects)
        ]
        return Precision(value, *_limits(value, left_out), local, sum(objects), tuple(left_out))

    def hidden_recall(self, overlap: int) -> HiddenRecall:
        """Return the recall of hidden objects at an overlap of OVERLAPS; NaN without such objects."""
        pairs = [
            (self._total(tally.hidden[overlap]) if tally.hidden else 0, self._total(record.hidden))
            for tally, record in zip(self._tallies, self._records, strict=True)
            if self._total(record.hidden)
        ]
        if not pairs:
            return HiddenRecall(math.nan, math.nan, math.nan, 0, 0)
        detected, total = (sum(counts) for counts in zip(*pairs, strict=True))
        value = detected / total
        left_out = [(detected - part) / (total - whole) if whole < total else math.nan for part, whole in pairs]
        return HiddenRecall(value, *_limits(value, left_out), detected, total)


def _limits(value: float, left_out: Sequence[float]) -> tuple[float, float]:
    """Return the limits of a value between 0 and 1 from those without each of the runs.

    They are NaN for a single run, or if the value is not defined without one of the runs.
    """
    if len(left_out) < 2 or any(map(math.isnan, left_out)):
        return math.nan, math.nan
    if value in (0.0, 1.0):
        # The runs do not differ, so that only their number says how rare the other outcome may be
        share = wilson(int(value) * len(left_out), len(left_out))
        return share.low, share.high
    if min(left_out) > 0.0 and max(left_out) < 1.0:
        # On this scale the limits are nearer to symmetric, and between 0 and 1
        logits = [math.log(share / (1.0 - share)) for share in (value, *left_out)]
        interval = jackknife_interval(logits[0], logits[1:])
        return _share(interval.low), _share(interval.high)
    interval = jackknife_interval(value, left_out)
    return max(interval.low, 0.0), min(interval.high, 1.0)


def _share(logit: float) -> float:
    return 0.5 + 0.5 * math.tanh(0.5 * logit)
