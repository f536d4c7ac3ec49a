"""Average precision and recall over the records of several runs, with jackknife intervals over the runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Bools
from eidrive_scenario.experiments.average_precision import area_in_order
from eidrive_scenario.experiments.cooperative_perception.samples import OVERLAPS, RANGES, PerceptionRecord
from eidrive_scenario.experiments.statistics.proportions import wilson
from eidrive_scenario.experiments.statistics.samples import jackknife_interval

_SECOND = 3 * len(OVERLAPS)


@dataclass(frozen=True)
class Precision:
    """Average precision with its 95 % interval.

    low, high  jackknife over the runs; NaN for a single one
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
    """Share of the objects hidden to the ego that are found, at any score, with its 95 % interval over the runs."""

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
        local = area_in_order(correct[kept], sum(objects))
        order = np.flatnonzero(kept)
        order = order[np.argsort(-self._scores[order], kind="stable")]
        right, scores, run = correct[order], self._scores[order], self._run[order]
        value = area_in_order(right, sum(objects), scores)
        left_out = [
            area_in_order(right[run != number], sum(objects) - count, scores[run != number])
            for number, count in enumerate(objects)
        ]
        return Precision(value, *_limits(value, left_out), local, sum(objects))

    def hidden_recall(self, overlap: int) -> HiddenRecall:
        """Return the recall of hidden objects at an overlap of OVERLAPS; NaN without such objects."""
        pairs = [
            (tally.hidden[overlap] if tally.hidden else 0, record.hidden)
            for tally, record in zip(self._tallies, self._records, strict=True)
            if record.hidden
        ]
        found, total = (sum(counts) for counts in zip(*pairs, strict=True)) if pairs else (0, 0)
        if not total:
            return HiddenRecall(float("nan"), float("nan"), float("nan"), 0, 0)
        value = found / total
        left_out = [(found - part) / (total - whole) if whole < total else float("nan") for part, whole in pairs]
        return HiddenRecall(value, *_limits(value, left_out), found, total)


def _limits(value: float, left_out: Sequence[float]) -> tuple[float, float]:
    """Return the limits of a value between 0 and 1 from those without each of the runs.

    They are NaN for a single run, or if the value is not defined without one of the runs.
    """
    if len(left_out) < 2 or any(map(math.isnan, left_out)):
        return float("nan"), float("nan")
    if value in (0.0, 1.0):
        # The runs do not differ, so that only their number says how rare the other outcome may be
        share = wilson(int(value) * len(left_out), len(left_out))
        return share.low, share.high
    if min(left_out) > 0.0 and max(left_out) < 1.0:
        # On this scale the limits are nearer to symmetric, and between 0 and 1
        logits = [math.log(one / (1.0 - one)) for one in (value, *left_out)]
        interval = jackknife_interval(logits[0], logits[1:])
        return _share(interval.low), _share(interval.high)
    interval = jackknife_interval(value, left_out)
    return max(interval.low, 0.0), min(interval.high, 1.0)


def _share(logit: float) -> float:
    return 0.5 + 0.5 * math.tanh(0.5 * logit)


def _total(counts: Sequence[int], place: int | None) -> int:
    return sum(counts) if place is None else counts[place]
