"""Average precision and recall over the records of several runs, with bootstrap intervals over the runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.experiments.average_precision import area_in_order
from eidrive_scenario.experiments.cooperative_perception.samples import OVERLAPS, RANGES, PerceptionRecord
from eidrive_scenario.randomness import generator

RESAMPLES = 400
"""Number of bootstrap samples of the runs."""
_SECOND = 3 * len(OVERLAPS)


@dataclass(frozen=True)
class Precision:
    """Average precision with its 95 % interval.

    low, high  percentile bootstrap over the runs
    local      average precision of detections in the order of the frames, sorted within a frame only
    objects    number of true objects
    """

    value: float
    low: float
    high: float
    local: float
    objects: int


@dataclass(frozen=True)
class HiddenRecall:
    """Share of the objects hidden to the ego that are found, at any score, with its bootstrap interval."""

    value: float
    low: float
    high: float
    found: int
    objects: int


class Pool:
    """Detections of one condition in all runs, frames in order."""

    def __init__(self, records: Sequence[PerceptionRecord], condition: str) -> None:
        self._records = records
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

    def precision(self, overlap: int, place: int | None = None) -> Precision:
        """Return the average precision at an overlap of OVERLAPS, in one range class or in all."""
        places = self._codes >> (3 * overlap + 1) & 3
        kept = places < len(RANGES) if place is None else places == place
        objects = [_total(record.objects, place) for record in self._records]
        return self._precision(self._codes >> (3 * overlap) & 1 == 1, kept, objects)

    def precision_of_hit_objects(self) -> Precision:
        """Return the average precision at the overlap 0.5 for objects that a lidar of any station hits."""
        kept = self._codes >> (_SECOND + 1) & 1 == 1
        return self._precision(self._codes >> _SECOND & 1 == 1, kept, [sum(record.hit) for record in self._records])

    def _precision(self, correct: Bools, kept: Bools, objects: Sequence[int]) -> Precision:
        order = np.flatnonzero(kept)
        order = order[np.argsort(-self._scores[order], kind="stable")]
        local = area_in_order(correct[kept], sum(objects))
        value = area_in_order(correct[order], sum(objects))
        low, high = _interval(correct[order], self._run[order], np.array(objects))
        return Precision(value, low, high, local, sum(objects))

    def hidden_recall(self, overlap: int) -> HiddenRecall:
        """Return the recall of hidden objects at an overlap of OVERLAPS; NaN without such objects."""
        found = np.array([tally.hidden[overlap] if tally.hidden else 0 for tally in self._tallies])
        total = np.array([record.hidden for record in self._records])
        if not total.sum():
            return HiddenRecall(float("nan"), float("nan"), float("nan"), 0, 0)
        weights = _weights(len(total))
        shares = (weights @ found) / np.maximum(weights @ total, 1)
        low, high = np.percentile(shares, (2.5, 97.5)).tolist()
        return HiddenRecall(float(found.sum() / total.sum()), low, high, int(found.sum()), int(total.sum()))


def _total(counts: Sequence[int], place: int | None) -> int:
    return sum(counts) if place is None else counts[place]


def _weights(runs: int) -> Integers:
    """Return how often each run is in each bootstrap sample (RESAMPLES, runs); equal for all conditions."""
    return generator(0, "perception bootstrap").multinomial(runs, [1.0 / runs] * runs, size=RESAMPLES)


def _interval(correct: Bools, run: Integers, objects: Integers) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of the average precision of sorted detections (N,).

    A run that is drawn k times contributes each of its detections and objects k times.
    """
    if not objects.sum():
        return float("nan"), float("nan")
    weights = _weights(len(objects))
    total = np.maximum(weights @ objects, 1)
    if not len(correct):
        return 0.0, 0.0
    counts: Array = weights[:, run].astype(np.float64)
    right = np.cumsum(counts * correct, axis=1)
    precision = right / np.maximum(np.cumsum(counts, axis=1), 1.0)
    envelope = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    areas = (np.diff(right, prepend=0.0, axis=1) * envelope).sum(axis=1) / total
    low, high = np.percentile(areas, (2.5, 97.5)).tolist()
    return low, high
