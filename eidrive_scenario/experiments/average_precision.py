"""Average precision and recall of detections, in images and in plan view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.perception.learned.networks.suppression import covered, overlap

LEAST_OVERLAP = 0.5
"""Minimum overlap of a detection with its object (intersection over union), as in PASCAL VOC."""


@dataclass(frozen=True)
class Matches:
    """Result of matching the detections of one image with its objects, of one class or of all.

    scores (N,); correct (N,) whether the detection matches an object; counted (N,) False for detections of ignored
    objects; found (M,) whether each object of the image, including ignored ones, is matched; taken (N,) row of the
    object that a detection matches, including ignored ones, or -1; empty if it is unknown
    """

    scores: Array
    correct: Bools
    counted: Bools
    found: Bools
    taken: Integers = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def match(boxes: Array, scores: Array, objects: Array, ignored: Bools) -> Matches:
    """Match detections (N, 4) with objects (M, 4) of one class; `ignored` (M,) objects are not required and not errors.

    As `match_by_share`; in addition, a detection that lies by half in an ignored object does not count.
    """
    harmless = covered(boxes, objects[ignored]).max(axis=1, initial=0.0) >= 0.5
    return match_by_share(overlap(boxes, objects), scores, ignored, LEAST_OVERLAP, harmless)


def match_by_share(
    shares: Array, scores: Array, ignored: Bools, least: float, harmless: Bools | None = None
) -> Matches:
    """Match detections with objects that they overlap by shares (N, M), by any overlap measure.

    In the order of `matching_order`, each detection takes the free object with the largest overlap if that is at least
    `least`. A detection that takes an ignored object does not count. Detections that are `harmless` (N,) do not count
    if they match no object.
    """
    order = matching_order(shares, scores)
    correct, counted = np.zeros(len(order), dtype=bool), np.ones(len(order), dtype=bool)
    matched = np.zeros(len(ignored), dtype=bool)
    taken = np.full(len(order), -1)
    for rank, row in enumerate(order.tolist()):
        free = np.where(matched, -1.0, shares[row])
        wanted = np.where(ignored, -1.0, free)
        best = int(np.argmax(wanted)) if len(wanted) else -1
        if best >= 0 and wanted[best] >= least:
            matched[best] = correct[rank] = True
            taken[rank] = best
            continue
        other = int(np.argmax(free)) if len(free) else -1
        if other >= 0 and free[other] >= least:
            matched[other] = True
            taken[rank] = other
            counted[rank] = False
        elif harmless is not None and harmless[row]:
            counted[rank] = False
    return Matches(scores[order], correct, counted, matched, taken)


def matching_order(shares: Array, scores: Array) -> Integers:
    """Return the rows of detections by descending score, and of one score by descending overlap with any object."""
    return np.lexsort((-shares.max(axis=1, initial=0.0), -scores))


def average_precision(matches: Sequence[Matches], objects: int) -> float:
    """Return the area under precision over recall, from all points sorted by score; NaN without objects.

    The precision at each recall is the maximum at that recall or a greater one (Everingham et al., The PASCAL VOC
    challenge: a retrospective, 2015, section 4.2). Detections of one score enter together, as a threshold admits all or
    none of them: so does KITTI's evaluation, and the area does not depend on the order of images. The scripts of PASCAL
    VOC, COCO and nuScenes let them enter in the order of the images.
    """
    scores, correct = _sorted_by_score(matches)
    return area_in_order(correct, objects, scores)


def area_in_order(correct: Bools, objects: int, scores: Array | Integers | None = None) -> float:
    """Return the area under precision over recall of detections in the given order; NaN without objects.

    Neighbors with equal `scores` enter together, and without scores each detection alone. OpenCOOD evaluates detections
    in the order of the frames, sorted by score within a frame only, unless a global sort is selected.
    """
    if objects == 0:
        return float("nan")
    recall, precision = _precision_recall(correct, objects, _last_of_equal(scores, len(correct)))
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float((np.diff(recall, prepend=0.0) * envelope).sum())


def _precision_recall(correct: Bools, objects: int, ends: Integers) -> tuple[Array, Array]:
    """Return recall and precision of the first detections up to each of the rows `ends` (K,)."""
    right = np.cumsum(correct)[ends]
    return right / max(objects, 1), right / (ends + 1)


def _last_of_equal(scores: Array | Integers | None, count: int) -> Integers:
    """Return the rows (K,) of sorted detections after which the score changes; all rows without scores."""
    if scores is None:
        return np.arange(count)
    return np.flatnonzero(np.append(np.diff(scores) != 0, True)[:count])


def _sorted_by_score(matches: Sequence[Matches]) -> tuple[Array, Bools]:
    """Return scores and correctness (N,) of the counted detections of the whole set, best score first."""
    if not matches:
        return np.empty(0), np.empty(0, dtype=bool)
    counted = np.concatenate([entry.counted for entry in matches])
    scores = np.concatenate([entry.scores for entry in matches])[counted]
    correct = np.concatenate([entry.correct for entry in matches])[counted]
    order = np.argsort(-scores, kind="stable")
    return scores[order], correct[order]


def precision_recall(matches: Sequence[Matches], objects: int) -> tuple[Array, Array]:
    """Return recall and precision (K,) at each of the K different scores of the whole set, best score first."""
    scores, correct = _sorted_by_score(matches)
    return _precision_recall(correct, objects, _last_of_equal(scores, len(correct)))


def best_confidence(matches: Sequence[Matches], objects: int) -> float:
    """Return the score threshold with the maximum F1, the harmonic mean of precision and recall.

    Raise ValueError if no detection is correct.
    """
    scores, correct = _sorted_by_score(matches)
    ends = _last_of_equal(scores, len(correct))
    recall, precision = _precision_recall(correct, objects, ends)
    if not len(recall) or recall[-1] == 0.0:
        raise ValueError("matches: no detection is correct (expected at least one)")
    f1 = 2.0 * precision * recall / np.maximum(precision + recall, 1e-12)
    return float(scores[ends[int(np.argmax(f1))]])


def recall_at(matches: Sequence[Matches], objects: int, score: float) -> float:
    """Return the share of objects that detections of at least this score find; NaN without objects."""
    if objects == 0:
        return float("nan")
    true_positives = sum(int((entry.correct & entry.counted & (entry.scores >= score)).sum()) for entry in matches)
    return true_positives / objects
