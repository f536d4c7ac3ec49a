"""Actors that a station knows, and its false tracks: its objects matched with the ground truth by distance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import components
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.view import WorldView

Source = Literal["own", "fused"]
"""Objects of a station: those that it perceives itself, or the result of fusion, which its planner gets."""


def nearest_pairs(first: Array, second: Array, within: float) -> list[tuple[int, int, float]]:
    """Return rows and horizontal distance [m] of pairs of boxes (N, 7) and (M, 7), each box in one pair at most.

    Pairs are formed in order of increasing distance of the centers, up to `within` [m].
    """
    if not len(first) or not len(second):
        return []
    offset = first[:, None, :2] - second[None, :, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    near = np.flatnonzero(distance <= within)
    pairs: list[tuple[int, int, float]] = []
    taken: tuple[set[int], set[int]] = set(), set()
    for flat in near[np.argsort(distance.ravel()[near], kind="stable")].tolist():
        row, other = divmod(flat, len(second))
        if row not in taken[0] and other not in taken[1]:
            taken[0].add(row)
            taken[1].add(other)
            pairs.append((row, other, float(distance[row, other])))
    return pairs


def known_actors(
    frame: Frame, station: str, source: Source, *, within: float, min_confidence: float = 0.0
) -> Mapping[str, float]:
    """Return the actors that a station knows, with the horizontal distance of their objects from them [m].

    An actor is known by an object whose center is at most `within` [m] from its own center. Each object stands for one
    actor only, so that duplicates and false objects do not count. The station itself is excluded.

    min_confidence  minimum probability of existence of an object, or its score if it has no such probability
    """
    step, view = frame.steps.get(station), frame.view
    if step is None:
        return {}
    objects = step.detections if source == "own" else step.fused
    boxes = objects.boxes
    if min_confidence > 0.0:
        boxes = boxes[objects.confidence >= min_confidence]
    others = [row for row, name in enumerate(view.names) if name != station]
    pairs = nearest_pairs(boxes, view.boxes[others].reshape(-1, 7), within)
    return {view.names[others[index]]: distance for _, index, distance in pairs}


Point = tuple[float, float]

GATE = 2.0
"""Maximum horizontal distance of the center of a true object from the body of another actor [m]."""
SAME = 4.0
"""Maximum distance of false objects of successive ticks that form one false track [m]; 80 m/s at a step of 0.05 s."""


class Brakings(NamedTuple):
    """Number of brakings of a station, and of those without a cause."""

    number: int
    without_cause: int


@dataclass
class _Station:
    """Counters of one station."""

    false: list[Point] = field(default_factory=list)
    """Positions of the false tracks in the last tick [m]."""
    tracks: int = 0
    braking: bool = False
    """Whether the station braked in the last tick."""
    brakings: int = 0
    without_cause: int = 0


class FalseTracks:
    """Counter of false tracks and of brakings without a cause, for every station with a planner.

    false track      maximal series of ticks in which the planner receives an object without a true actor within GATE.
                     Its probability of existence is at least `min_existence` of the station. Objects of successive
                     ticks within SAME of each other continue one track. The ego body is not a true object.
    braking          maximal series of ticks in which `Plan.braking` is set, or the deceleration of the plan exceeds
                     `harder_than` [m/s²]
    without a cause  all objects that the planner states as reason (`Plan.objects`) in the first tick of the braking
                     are false. A braking without stated objects has a cause.

    Ground truth is used only here and in criteria, never by a planner.
    """

    def __init__(self, harder_than: float = math.inf) -> None:
        self._harder_than = harder_than
        self._stations: dict[str, _Station] = {}
        self._start = self._end = math.nan

    def observe(self, frame: Frame, min_existence: Mapping[str, float]) -> None:
        """Process one frame. `min_existence` maps stations with a planner to their probability threshold."""
        view = frame.view
        if self._start != self._start:
            self._start = view.time
        self._end = view.time
        for name, limit in min_existence.items():
            step = frame.steps.get(name)
            if step is None or step.plan is None:
                continue
            station = self._stations.setdefault(name, _Station())
            boxes, existence = step.fused.boxes.tolist(), step.fused.confidence.tolist()
            rows = [row for row in _unmatched(boxes, view, view.rows.get(name)) if existence[row] >= limit]
            points = [(boxes[row][0], boxes[row][1]) for row in rows]
            station.tracks += sum(all(math.dist(point, before) > SAME for before in station.false) for point in points)
            station.false = points
            braking = step.plan.braking is not None or -step.plan.acceleration > self._harder_than
            if braking and not station.braking:
                station.brakings += 1
                reasons = step.plan.objects
                station.without_cause += bool(reasons) and all(row in rows for row in reasons)
            station.braking = braking

    def brakings(self, station: str) -> Brakings:
        """Return the brakings of a station."""
        observed = self._stations.get(station, _Station())
        return Brakings(observed.brakings, observed.without_cause)

    def metrics(self) -> dict[str, float]:
        """Return `false_tracks.NAME.per_minute`, `.brakings` and `.brakings_without_cause` of each station."""
        metrics: dict[str, float] = {}
        minutes = (self._end - self._start) / 60.0
        for name, station in self._stations.items():
            metrics[f"false_tracks.{name}.per_minute"] = station.tracks / minutes if minutes > 0.0 else 0.0
            metrics[f"false_tracks.{name}.brakings"] = station.brakings
            metrics[f"false_tracks.{name}.brakings_without_cause"] = station.without_cause
        return metrics


def _unmatched(boxes: Sequence[Sequence[float]], view: WorldView, own: int | None) -> list[int]:
    """Return the rows of objects without a true actor within GATE, other than that in row `own`."""
    bodies = [body for row, body in enumerate(view.plain_boxes) if row != own]
    return [row for row, (x, y, *_) in enumerate(boxes) if not any(_beside(x, y, body) for body in bodies)]


def _beside(x: float, y: float, body: Sequence[float]) -> bool:
    """True if a point is inside the outline of a body (7,) or at most GATE outside it."""
    ahead, aside = components(x - body[0], y - body[1], body[6])
    ahead, aside = max(abs(ahead) - body[3] / 2.0, 0.0), max(abs(aside) - body[4] / 2.0, 0.0)
    return ahead * ahead + aside * aside <= GATE * GATE
