"""Average precision and recall of detections, in pictures and seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.perception.learned.networks.suppression import covered, overlap

LEAST_OVERLAP = 0.5


@dataclass(frozen=True)
class Matches:
    """What the detections in one picture came to, those of one class or of all.

    scores (N,); correct (N,) the detection found an object; counted (N,) False for what fell on an ignored object;
    found (M,) whether each object of the picture, ignored ones included, was found
    """

    scores: Array
    correct: Bools
    counted: Bools
    found: Bools


def match(boxes: Array, scores: Array, objects: Array, ignored: Bools, least: float = LEAST_OVERLAP) -> Matches:
    """Detections (N, 4) against objects (M, 4) of one class; `ignored` (M,) need not be found and do no harm.

    As `match_by_share`; a detection that lies by half in an ignored object does not count either.
    """
    return match_by_share(
        overlap(boxes, objects),
        scores,
        ignored,
        least,
        covered(boxes, objects[ignored]).max(axis=1, initial=0.0) >= 0.5,
    )


def match_by_share(
    shares: Array, scores: Array, ignored: Bools, least: float, harmless: Bools | None = None
) -> Matches:
    """Detections against objects that they overlap by shares (N, M), in any sense; `harmless` (N,) do not count if they
    find nothing.

    Best detection first, each takes the object that it overlaps most among those still free, if by `least`. One that
    takes an ignored object does not count.
    """
    order = np.argsort(-scores, kind="stable")
    correct, counted = np.zeros(len(order), dtype=bool), np.ones(len(order), dtype=bool)
    found = np.zeros(len(ignored), dtype=bool)
    for rank, row in enumerate(order.tolist()):
        free = np.where(found, -1.0, shares[row])
        wanted = np.where(ignored, -1.0, free)
        best = int(np.argmax(wanted)) if len(wanted) else -1
        if best >= 0 and wanted[best] >= least:
            found[best] = correct[rank] = True
            continue
        other = int(np.argmax(free)) if len(free) else -1
        if other >= 0 and free[other] >= least:
            found[other] = True
            counted[rank] = False
        elif harmless is not None and harmless[row]:
            counted[rank] = False
    return Matches(scores[order], correct, counted, found)


def average_precision(matches: Sequence[Matches], objects: int) -> float:
    """Area under precision over recall, all points, the detections of the whole set sorted by score; NaN without any
    object.

    At each recall counts the best precision at that recall or a greater one (Everingham et al., The PASCAL VOC
    challenge: a retrospective, 2015, section 4.2).
    """
    recall, precision = precision_recall(matches, objects)
    if objects == 0:
        return float("nan")
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    steps = np.diff(recall, prepend=0.0)
    return float((steps * envelope).sum())


def precision_recall(matches: Sequence[Matches], objects: int) -> tuple[Array, Array]:
    """Recall and precision (K,) over the detections of the whole set, best score first."""
    if not matches:
        return np.empty(0), np.empty(0)
    counted = np.concatenate([entry.counted for entry in matches])
    scores = np.concatenate([entry.scores for entry in matches])[counted]
    correct = np.concatenate([entry.correct for entry in matches])[counted]
    order = np.argsort(-scores, kind="stable")
    right = np.cumsum(correct[order])
    return right / max(objects, 1), right / np.arange(1, len(order) + 1)


def best_confidence(matches: Sequence[Matches], objects: int) -> float:
    """The score from which on to believe detections so that F1, the harmonic mean of precision and recall, is largest.

    Raises ValueError where nothing was found.
    """
    recall, precision = precision_recall(matches, objects)
    if not len(recall) or recall[-1] == 0.0:
        raise ValueError("without any right detection there is no best confidence")
    scores = np.concatenate([entry.scores[entry.counted] for entry in matches])
    f1 = 2.0 * precision * recall / np.maximum(precision + recall, 1e-12)
    return float(np.sort(scores)[::-1][int(np.argmax(f1))])


def recall_at(matches: Sequence[Matches], objects: int, score: float) -> float:
    """Share of the objects found by detections of at least this score; NaN without any object."""
    if objects == 0:
        return float("nan")
    found = sum(int((entry.correct & entry.counted & (entry.scores >= score)).sum()) for entry in matches)
    return found / objects
