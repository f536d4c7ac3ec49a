"""False tracks in closed loop: objects that a planner is given and that do not exist, and brakings for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float]

GATE = 2.0
"""An object is true if its center lies in the body of another actor, seen from above, or at most this far beside it
[m]."""
SAME = 4.0
"""False objects of successive ticks at most this far apart are one false track [m]: a speed of 80 m/s at 0.05 s."""


@dataclass
class _Station:
    """Counts of one station so far."""

    false: list[Point] = field(default_factory=list)
    """Places of the false tracks in the last tick."""
    tracks: int = 0
    braking: bool = False
    """Whether it braked in the last tick."""
    brakings: int = 0
    without_cause: int = 0


class FalseTracks:
    """Counts false tracks and brakings without a cause of every station with a planner; a fold over frames.

    false track      a maximal series of ticks in which the planner is given an object that exists with at least
                     `min_existence` of its station, without a true actor within GATE of it. Objects of successive ticks
                     within SAME of each other continue one track. The own body is no true object.
    braking          a maximal series of ticks in which `Plan.braking` is set
    without a cause  all objects that the planner states as its reason (`Plan.objects`) in the first tick of the braking
                     are false. A braking for which no object is stated has a cause.

    The truth is used here and in criteria only; no planner learns of it.
    """

    def __init__(self) -> None:
        self._stations: dict[str, _Station] = {}
        self._start = self._end = math.nan

    def observe(self, frame: Frame, least: Mapping[str, float]) -> None:
        """Count what happened in one frame; `least` is `min_existence` of the stations that plan, by name."""
        view = frame.view
        if self._start != self._start:
            self._start = view.time
        self._end = view.time
        for name, limit in least.items():
            step = frame.steps.get(name)
            if step is None or step.plan is None:
                continue
            station = self._stations.get(name)
            if station is None:
                station = self._stations[name] = _Station()
            boxes = step.fused.boxes.tolist()
            rows = _unmatched(boxes, view, view.rows.get(name, -1)) if boxes else ()
            if rows:
                existence = step.fused.confidence.tolist()
                rows = [row for row in rows if existence[row] >= limit]
            if rows or station.false:
                places = [(boxes[row][0], boxes[row][1]) for row in rows]
                station.tracks += sum(
                    all(math.dist(place, before) > SAME for before in station.false) for place in places
                )
                station.false = places
            braking = step.plan.braking is not None
            if braking and not station.braking:
                station.brakings += 1
                reasons = step.plan.objects
                station.without_cause += bool(reasons) and all(row in rows for row in reasons)
            station.braking = braking

    def metrics(self) -> dict[str, float]:
        """For each station: `false_tracks.NAME.per_minute`, `.brakings`, `.brakings_without_cause`."""
        found: dict[str, float] = {}
        minutes = (self._end - self._start) / 60.0
        for name, station in self._stations.items():
            found[f"false_tracks.{name}.per_minute"] = station.tracks / minutes if minutes > 0.0 else 0.0
            found[f"false_tracks.{name}.brakings"] = station.brakings
            found[f"false_tracks.{name}.brakings_without_cause"] = station.without_cause
        return found


def _unmatched(boxes: Sequence[Sequence[float]], view: WorldView, own: int) -> Sequence[int]:
    """The rows of the objects without a true actor within GATE."""
    bodies = view.plain_boxes
    found = []
    for row, box in enumerate(boxes):
        x, y = box[0], box[1]
        for index, body in enumerate(bodies):
            dx, dy = x - body[0], y - body[1]
            if dx * dx + dy * dy <= GATE * GATE and index != own:
                break
        else:
            if not any(index != own and _beside(x, y, body) for index, body in enumerate(bodies)):
                found.append(row)
    return found


def _beside(x: float, y: float, body: Sequence[float]) -> bool:
    """Whether a point is in the outline of a body (7,) or at most GATE beside it."""
    cos, sin = math.cos(body[6]), math.sin(body[6])
    dx, dy = x - body[0], y - body[1]
    ahead = max(abs(cos * dx + sin * dy) - body[3] / 2.0, 0.0)
    aside = max(abs(cos * dy - sin * dx) - body[4] / 2.0, 0.0)
    return ahead * ahead + aside * aside <= GATE * GATE
