"""The decisive instants of a run in which one car is hidden from another, and their distance over time."""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import box_distance, points_in_polygon
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import SnapshotBuilder, StationSnapshot

NEAR = 3.0
"""A box whose center is this near to where the car was then is taken for it [m]."""


@dataclass(frozen=True)
class Moment:
    """One decisive instant: what happened, and the picture; None where it never came to that."""

    kind: str
    """heard or hidden, entered, braked, closest"""
    title: str
    snapshot: StationSnapshot | None


@dataclass(frozen=True)
class Story:
    """A run in short: the decisive instants in order, and series over time.

    times (N,) [s], centers and boxes (N,) distance between centers and between bodies [m], speeds (N,) of the ego [m/s]
    """

    ego: str
    hidden: str
    moments: tuple[Moment, ...]
    times: tuple[float, ...]
    centers: tuple[float, ...]
    boxes: tuple[float, ...]
    speeds: tuple[float, ...]
    touched: bool
    """Whether the two bodies touched."""

    def moment(self, kind: str) -> Moment:
        """The moment of that kind. Raise KeyError if there is none."""
        for moment in self.moments:
            if moment.kind == kind:
                return moment
        raise KeyError(kind)


class KeyFrames:
    """An observer of a run that keeps its decisive instants.

    heard    the ego knows the car from others alone; where it never does:
    hidden   others see the car, and the ego does not (any more)
    entered  the car's center enters a conflict area, where there are any
    braked   the ego brakes with a deceleration that its plan asks for
    closest  the smallest gap between the bodies, or their first touch

    `areas` are the conflict areas, polygons (M, 2) [m].
    """

    def __init__(self, ego: str, hidden: str, areas: Sequence[Array] = ()) -> None:
        self.ego, self.hidden, self.areas = ego, hidden, tuple(areas)
        self._knowledge = SnapshotBuilder(ego)
        self._times: list[float] = []
        self._where: list[tuple[float, float]] = []
        self._centers: list[float] = []
        self._boxes: list[float] = []
        self._speeds: list[float] = []
        self._met: list[float] = []
        self._found: dict[str, tuple[str, StationSnapshot]] = {}
        self._least = (math.inf, math.inf)
        self._touched = False

    def observe(self, frame: Frame) -> None:
        """Take the next frame."""
        snapshot = self._knowledge.observe(frame)
        view = frame.view
        self._times.append(view.time)
        present = self.ego in view and self.hidden in view
        hidden = view.boxes[view.row(self.hidden)].tolist() if present else [math.nan] * 7
        self._where.append((hidden[0], hidden[1]))
        if not present:
            return
        self._measure(view.boxes[view.row(self.ego)].tolist(), hidden, snapshot)
        self._notice(frame, snapshot)

    def close(self) -> None:
        """Nothing to release."""

    def story(self) -> Story:
        """What was found so far."""
        moments = []
        first = "heard" if "heard" in self._found else "hidden"
        for kind, absent in (
            (first, f"{self.hidden} is never in sight of others alone"),
            ("entered", f"{self.hidden} never enters the conflict area"),
            ("braked", f"{self.ego} never brakes for it"),
            ("closest", "the two are never there together"),
        ):
            if kind == "entered" and not self.areas:
                continue
            title, snapshot = self._found.get(kind, (absent, None))
            moments.append(Moment(kind, title, snapshot and _portable(snapshot)))
        return Story(
            self.ego,
            self.hidden,
            tuple(moments),
            tuple(self._met),
            tuple(self._centers),
            tuple(self._boxes),
            tuple(self._speeds),
            self._touched,
        )

    def _measure(self, ego: list[float], hidden: list[float], snapshot: StationSnapshot) -> None:
        center, box = math.dist(ego[:2], hidden[:2]), box_distance(ego, hidden)
        self._met.append(snapshot.time)
        self._centers.append(center)
        self._boxes.append(box)
        self._speeds.append(float(snapshot.view.speed[snapshot.view.row(self.ego)]))
        if self._touched:
            return
        pair = {self.ego, self.hidden}
        self._touched = box == 0.0 or any({touch.first, touch.second} == pair for touch in snapshot.view.contacts)
        if self._touched or (box, center) < self._least:
            self._least = (box, center)
            title = f"{self.hidden} and {self.ego} collide" if self._touched else f"closest, {box:.2f} m apart"
            self._found["closest"] = (title, snapshot)

    def _notice(self, frame: Frame, snapshot: StationSnapshot) -> None:
        step = snapshot.step
        if not self._shows(snapshot.own):
            if "hidden" not in self._found:
                others = [name for name, at in frame.steps.items() if name != self.ego and self._shows(at.detections)]
                if others:
                    title = (
                        f"{_listed(others)} {'sees' if len(others) == 1 else 'see'} {self.hidden}, {self.ego} does not"
                    )
                    self._found["hidden"] = (title, snapshot)
            if "heard" not in self._found:
                senders = [held.message.sender for held in snapshot.heard if self._shows(held.message.detections)]
                if senders:
                    title = f"{self.ego} knows {self.hidden} from {_listed(list(dict.fromkeys(senders)))} alone"
                    self._found["heard"] = (title, snapshot)
        if "entered" not in self._found and self.areas:
            at = snapshot.view.centers[snapshot.view.row(self.hidden), :2]
            if any(points_in_polygon(at, area) for area in self.areas):
                self._found["entered"] = (f"{self.hidden} enters the conflict area", snapshot)
        if "braked" not in self._found and step is not None and step.plan is not None and step.plan.braking is not None:
            self._found["braked"] = (f"{self.ego} brakes", snapshot)

    def _shows(self, detections: Detections) -> bool:
        """Whether one of the boxes lies where the hidden car was at the time of the measurement."""
        row = min(bisect.bisect_left(self._times, detections.time - 1e-9), len(self._where) - 1)
        x, y = self._where[row]
        return any(math.hypot(box[0] - x, box[1] - y) <= NEAR for box in detections.boxes.tolist())


def _portable(snapshot: StationSnapshot) -> StationSnapshot:
    """The same with a view that holds nothing but its arrays: what a view caches does not travel between processes."""
    return dataclasses.replace(snapshot, view=dataclasses.replace(snapshot.view))


def _listed(names: list[str]) -> str:
    return " and ".join(names)
