"""Criterion: minimum post-encroachment time of two actors (PET)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from eidrive_criteria.pairs import PairCriterion, PairSettings
from eidrive_scenario.api.common import WorldView, overlap
from eidrive_scenario.api.criteria import Continuity, Frame

HORIZON = 10.0
"""Maximum post-encroachment time that is measured [s]."""
STEPS = 20
"""Bisections of a time step; the times are exact to 1e-6 of it."""

Body = Sequence[float]


class PostEncroachmentTimeSettings(PairSettings):
    """Settings: `{of: Ego, to: Crossing, at_least: 1.5}` [s]. Without `at_least` it only measures and passes."""


@dataclass(frozen=True)
class Trace:
    """Body of an actor in a frame; `moved` is False if it was absent or elsewhere in the frame before."""

    time: float
    body: Body
    moved: bool


class Trail:
    """Bodies of one actor in the last HORIZON seconds, oldest first."""

    def __init__(self) -> None:
        self.past: deque[Trace] = deque()
        self._continuity = Continuity()

    def add(self, view: WorldView, row: int | None) -> None:
        """Add the body of this frame, if the actor is present; delete the bodies before the horizon."""
        step = self._continuity.step(view, row)
        if row is not None:
            self.past.append(Trace(view.time, view.plain_boxes[row], step is not None))
        while self.past and self.past[0].time < view.time - HORIZON:
            self.past.popleft()

    def last_over(self, body: Body) -> int | None:
        """Return the index of the latest recorded body that overlaps `body`; None if there is none."""
        reach = math.hypot(body[3], body[4])
        for index in range(len(self.past) - 1, -1, -1):
            other = self.past[index].body
            near = (reach + math.hypot(other[3], other[4])) / 2.0
            if abs(other[0] - body[0]) <= near and abs(other[1] - body[1]) <= near and overlap(other, body):
                return index
        return None


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
        value = self.measure(view, 0, 0)
        if value < self.smallest:
            self.smallest, self.when = value, view.time
        if self._violated is None and self.limit is not None and value < self.limit:
            self._violated = view.time

    def measure(self, view: WorldView, of: int, to: int) -> float:
        """Return the smaller time of both orders with an arrival in this frame; infinite if there is none."""
        first, second = self._trails[self.of], self._trails[self.to]
        return min(time_between(first, second, view.time), time_between(second, first, view.time))

    def describe_smallest(self) -> str:
        if not math.isfinite(self.smallest):
            return f"{self.of} and {self.to} were at no common place within {HORIZON:.0f} s"
        return (
            f"{self.of} and {self.to} were at one place {self.smallest:.2f} s apart, the later one at {self.when:.2f} s"
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the minimum post-encroachment time [s]; empty without a common place."""
        pair = f"{self.name}.{self.of}.{self.to}"
        return {pair: self.smallest} if math.isfinite(self.smallest) else {}


def time_between(leaving: Trail, arriving: Trail, now: float) -> float:
    """Return the time from the departure of one actor from where the other one arrives now; infinite if there is none.

    Between frames the bodies move at constant velocity. An actor that disappears departs with its last frame.
    """
    if not arriving.past or arriving.past[-1].time != now:
        return math.inf
    present = arriving.past[-1]
    index = leaving.last_over(present.body)
    if index is None:
        return math.inf
    inside = leaving.past[index]
    if inside.time == now:
        return 0.0
    departure, last = inside.time, inside.body
    if index + 1 < len(leaving.past) and leaving.past[index + 1].moved:
        departure, last = _change(inside, leaving.past[index + 1], present.body)
    arrival = now
    if present.moved and not overlap(arriving.past[-2].body, last):
        arrival, _ = _change(present, arriving.past[-2], last)
    return arrival - departure


def _change(inside: Trace, outside: Trace, area: Body) -> tuple[float, Body]:
    """Return the last time and body between two frames, from the first one on, at which the body overlaps a place."""
    low, high = 0.0, 1.0
    for _ in range(STEPS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if overlap(_between(inside.body, outside.body, middle), area) else (low, middle)
    return inside.time + low * (outside.time - inside.time), _between(inside.body, outside.body, low)


def _between(a: Body, b: Body, share: float) -> Body:
    turn = math.remainder(b[6] - a[6], math.tau)
    return (*(p + share * (q - p) for p, q in zip(a[:6], b[:6], strict=True)), a[6] + share * turn)
