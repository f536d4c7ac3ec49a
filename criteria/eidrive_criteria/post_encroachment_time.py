"""Criterion: minimum post-encroachment time of two actors (PET)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_criteria.pairs import PairCriterion, PairSettings, has_contact
from eidrive_scenario.api.common import WorldView
from eidrive_scenario.api.criteria import Continuity, Frame, half_projection, separating_axes

HORIZON = 10.0
"""Maximum post-encroachment time that is measured [s]."""

Body = Sequence[float]
Point = tuple[float, float]


class PostEncroachmentTimeSettings(PairSettings):
    """Settings: `{of: Ego, to: Crossing, at_least: 1.5}` [s]. Without `at_least` it only measures and passes."""


@dataclass(frozen=True)
class Motion:
    """Motion of a body from one frame to the next; both are one frame after an absence or a teleport.

    middle  body at half the time, with the mean heading
    reach   radius of the circle around its center that contains all bodies of the motion [m]
    """

    begin: float
    end: float
    first: Body
    last: Body
    middle: Body
    reach: float


class Trail:
    """Motions of one actor in the last HORIZON seconds, oldest first."""

    def __init__(self) -> None:
        self.past: deque[Motion] = deque()
        self._continuity = Continuity()

    def add(self, view: WorldView, row: int | None) -> None:
        """Add the motion up to this frame, if the actor is present; delete the motions before the horizon."""
        step = self._continuity.step(view, row)
        if row is not None:
            last, end = view.plain_boxes[row], view.time
            begin, first = (end, last) if step is None else (self.past[-1].end, self.past[-1].last)
            turn = math.remainder(last[6] - first[6], math.tau)
            middle = *((a + b) / 2.0 for a, b in zip(first[:6], last[:6], strict=True)), first[6] + turn / 2.0
            reach = (math.hypot(last[3], last[4]) + math.dist(first[:2], last[:2])) / 2.0
            self.past.append(Motion(begin, end, first, last, middle, reach))
        while self.past and self.past[0].end < view.time - HORIZON:
            self.past.popleft()


class PostEncroachmentTime(PairCriterion):
    """Criterion that fails if the post-encroachment time falls below `at_least`.

    It is the time between the moment at which one actor leaves a place and the moment at which the other one arrives
    there, in both orders, and 0 in a crash. It is defined only if both have been at one place within HORIZON.
    """

    settings_type = PostEncroachmentTimeSettings
    name = "post_encroachment_time"
    unit = "s"

    def __init__(self, settings: PostEncroachmentTimeSettings) -> None:
        super().__init__(settings)
        self._trails = {settings.of: Trail(), settings.to: Trail()}

    def observe(self, frame: Frame) -> None:
        view = frame.view
        for name, trail in self._trails.items():
            row = view.rows.get(name)
            trail.add(view, row)
            if row is not None:
                self._missing.discard(name)
        self._together = not self._missing
        self._add(self.measure(view, 0, 0), view.time)

    def measure(self, view: WorldView, of: int, to: int) -> float:
        """Return the smaller time of both orders with an arrival in this frame; infinite if there is none."""
        if has_contact(view, self.of, self.to):
            return 0.0  # Motion at constant velocity between frames does not reach the other body of a crash.
        first, second = self._trails[self.of], self._trails[self.to]
        of_first = time_between(first, second, view.time, self.smallest)
        return min(of_first, time_between(second, first, view.time, min(self.smallest, of_first)))

    def describe_smallest(self) -> str:
        if not math.isfinite(self.smallest):
            return f"{self.of} and {self.to} were at no common place within {HORIZON:.0f} s"
        return (
            f"{self.of} and {self.to} were at one place {self.smallest:.2f} s apart, the later one at {self.when:.2f} s"
        )


def time_between(leaving: Trail, arriving: Trail, now: float, below: float = math.inf) -> float:
    """Return the time from the departure of one actor from where the other one arrives now; infinite if there is none.

    Between frames the bodies move at constant velocity. An actor that disappears departs with its last frame.

    below  time from which on the result is infinite [s]
    """
    smallest = min(below, HORIZON)
    if not arriving.past or arriving.past[-1].end != now:
        return math.inf
    arrival = arriving.past[-1]
    for departure in reversed(leaving.past):
        if arrival.begin - departure.end >= smallest:
            break
        reach = departure.reach + arrival.reach
        if abs(departure.middle[0] - arrival.middle[0]) <= reach >= abs(departure.middle[1] - arrival.middle[1]):
            smallest = min(smallest, _shortest(departure, arrival))
    return smallest if smallest < min(below, HORIZON) else math.inf


def _shortest(departure: Motion, arrival: Motion) -> float:
    """Return the shortest time from an instant of one motion to a later one of the other at which the bodies overlap.

    Two bodies with constant headings overlap if the projections of their distance on all separating axes are within
    the sum of their extents. The pairs of instants, as shares of both motions, then form a convex polygon, and the time
    between them is linear: it is the least at a corner.
    """
    gap, moved, came = (
        [b - a for a, b in zip(start[:3], stop[:3], strict=True)]
        for start, stop in (
            (departure.first, arrival.first),
            (departure.first, departure.last),
            (arrival.first, arrival.last),
        )
    )
    a, b = departure.middle, arrival.middle
    delay = arrival.begin - departure.begin, departure.begin - departure.end, arrival.end - arrival.begin
    polygon = _clipped(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)), *delay)
    for axis in separating_axes(a, b):
        reach = half_projection(a, *axis) + half_projection(b, *axis)
        apart, away, nearer = (sum(p * q for p, q in zip(axis, vector, strict=True)) for vector in (gap, moved, came))
        polygon = _clipped(polygon, reach - apart, away, -nearer)
        polygon = _clipped(polygon, reach + apart, -away, nearer)
    return min((max(delay[0] + u * delay[1] + v * delay[2], 0.0) for u, v in polygon), default=math.inf)


def _clipped(polygon: Sequence[Point], constant: float, by_u: float, by_v: float) -> Sequence[Point]:
    """Return the part of a convex polygon in which `constant + by_u * u + by_v * v` is at least 0."""
    values = [constant + by_u * u + by_v * v for u, v in polygon]
    if min(values, default=0.0) >= 0.0:
        return polygon
    kept: list[Point] = []
    for index, (u, v) in enumerate(polygon):
        before, value = values[index - 1], values[index]
        if (before < 0.0) != (value < 0.0):
            share, (x, y) = before / (before - value), polygon[index - 1]
            kept.append((x + share * (u - x), y + share * (v - y)))
        if value >= 0.0:
            kept.append((u, v))
    return kept
