"""Key frames of a run in which one car is occluded from another, and their distance over time."""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from eidrive_scenario.api.common import TIME_TOLERANCE, Array, box_distance, points_in_polygon
from eidrive_scenario.api.criteria import Frame
from eidrive_scenario.api.driving import Detections
from eidrive_scenario.api.pages import SnapshotBuilder, StationSnapshot

NEAR = 3.0
"""Maximum distance between the center of a detection and the true position of the car at that time [m]."""


@dataclass(frozen=True)
class Moment:
    """Key frame: its kind, title and snapshot; None if the event did not occur."""

    kind: str
    """Kind of the event: received or hidden, entered, braked, closest."""
    title: str
    snapshot: StationSnapshot | None


@dataclass(frozen=True)
class Story:
    """Summary of a run: key frames in order, and series over time.

    times    (N,) [s]
    centers  (N,) distance between centers [m]
    boxes    (N,) distance between bodies [m]
    speeds   (N,) of the ego [m/s]; that of the impact where a contact begins
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
        """Return the key frame of that kind. Raise KeyError if there is none."""
        for moment in self.moments:
            if moment.kind == kind:
                return moment
        raise KeyError(kind)


class KeyFrames:
    """Observer of a run that stores its key frames.

    received  only messages of others contain the car; without such a frame:
    hidden    other stations detect the car, and the ego does not
    entered   the center of the car enters a conflict area, if there are any
    braked    the ego brakes with a deceleration of its plan
    closest   minimum distance between the bodies, or their first contact

    `areas` are the conflict areas, polygons (M, 2) [m].
    """

    def __init__(self, ego: str, hidden: str, areas: Sequence[Array] = ()) -> None:
        self.ego, self.hidden, self.areas = ego, hidden, tuple(areas)
        self._builder = SnapshotBuilder(ego)
        self._times: list[float] = []
        self._positions: list[tuple[float, float]] = []
        self._series: list[tuple[float, float, float, float]] = []
        """Time, distances between centers and bodies, and speed of the ego, while both cars are present."""
        self._events: dict[str, tuple[str, StationSnapshot]] = {}
        self._least = (math.inf, math.inf)
        self._touched = False

    def observe(self, frame: Frame) -> None:
        """Process the next frame."""
        snapshot = self._builder.observe(frame)
        view = frame.view
        self._times.append(view.time)
        present = self.ego in view and self.hidden in view
        hidden = view.boxes[view.row(self.hidden)].tolist() if present else [math.nan] * 7
        self._positions.append((hidden[0], hidden[1]))
        if not present:
            return
        self._measure(view.boxes[view.row(self.ego)].tolist(), hidden, snapshot)
        self._find_events(frame, snapshot)

    def close(self) -> None:
        """Do nothing: required by the observer protocol."""

    def story(self) -> Story:
        """Return the key frames and series of the frames so far."""
        moments = []
        first = "received" if "received" in self._events else "hidden"
        for kind, absent in (
            (first, f"{self.hidden} is never detected by others only"),
            ("entered", f"{self.hidden} never enters the conflict area"),
            ("braked", f"{self.ego} never brakes"),
            ("closest", "the two are never present at the same time"),
        ):
            if kind == "entered" and not self.areas:
                continue
            title, snapshot = self._events.get(kind, (absent, None))
            moments.append(Moment(kind, title, snapshot and _portable(snapshot)))
        times, centers, boxes, speeds = zip(*self._series, strict=True) if self._series else ((), (), (), ())
        return Story(self.ego, self.hidden, tuple(moments), times, centers, boxes, speeds, self._touched)

    def _measure(self, ego: list[float], hidden: list[float], snapshot: StationSnapshot) -> None:
        center, box = math.dist(ego[:2], hidden[:2]), box_distance(ego, hidden)
        self._series.append((snapshot.time, center, box, snapshot.speeds[self.ego]))
        if self._touched:
            return
        pair = {self.ego, self.hidden}
        self._touched = box == 0.0 or any({touch.first, touch.second} == pair for touch in snapshot.view.contacts)
        if self._touched or (box, center) < self._least:
            self._least = (box, center)
            collision = f"{self.hidden} and {self.ego} collide"
            title = collision if self._touched else f"minimum distance, {box:.2f} m"
            self._events["closest"] = (title, snapshot)

    def _find_events(self, frame: Frame, snapshot: StationSnapshot) -> None:
        step = snapshot.step
        titles = {}
        if not self._shows(snapshot.own):
            if others := [name for name, at in frame.steps.items() if name != self.ego and self._shows(at.detections)]:
                sees = "sees" if len(others) == 1 else "see"
                titles["hidden"] = f"{' and '.join(others)} {sees} {self.hidden}, {self.ego} does not"
            if senders := [held.message.sender for held in snapshot.received if self._shows(held.message.detections)]:
                names = " and ".join(dict.fromkeys(senders))
                titles["received"] = f"{self.ego} receives {self.hidden} only from {names}"
        at = snapshot.view.centers[snapshot.view.row(self.hidden), :2]
        if any(points_in_polygon(at, area) for area in self.areas):
            titles["entered"] = f"{self.hidden} enters the conflict area"
        if step is not None and step.plan is not None and step.plan.braking is not None:
            titles["braked"] = f"{self.ego} brakes"
        for kind, title in titles.items():
            self._events.setdefault(kind, (title, snapshot))

    def _shows(self, detections: Detections) -> bool:
        """True if a detection is near the position of the occluded car at the time of measurement."""
        row = min(bisect.bisect_left(self._times, detections.time - TIME_TOLERANCE), len(self._positions) - 1)
        x, y = self._positions[row]
        return any(math.hypot(box[0] - x, box[1] - y) <= NEAR for box in detections.boxes.tolist())


def _portable(snapshot: StationSnapshot) -> StationSnapshot:
    """Return a copy whose view has no cached values, which cannot be pickled."""
    return dataclasses.replace(snapshot, view=msgspec.structs.replace(snapshot.view))
