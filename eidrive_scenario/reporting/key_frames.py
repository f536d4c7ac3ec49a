"""The decisive instants of a run in which one car is hidden from another, and their distance over time."""

from __future__ import annotations

import bisect
import dataclasses
import math
from dataclasses import dataclass

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import box_distance
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import Knowledge, Snapshot

NEAR = 3.0
"""A box whose centre is this near to where the car was then is taken for it [m]."""


@dataclass(frozen=True)
class Moment:
    """One decisive instant: what happened, and the picture; None where it never came to that."""

    kind: str
    """seen, heard, braked or closest"""
    title: str
    snapshot: Snapshot | None


@dataclass(frozen=True)
class Story:
    """A run in short: the decisive instants in order, and series over time.

    times (N,) [s], centres and boxes (N,) distance between centres and between bodies [m], speeds (N,) of the ego [m/s]
    """

    ego: str
    hidden: str
    moments: tuple[Moment, ...]
    times: tuple[float, ...]
    centres: tuple[float, ...]
    boxes: tuple[float, ...]
    speeds: tuple[float, ...]

    def moment(self, kind: str) -> Moment:
        """The moment of that kind. Raises KeyError if there is none."""
        for moment in self.moments:
            if moment.kind == kind:
                return moment
        raise KeyError(kind)


class KeyFrames:
    """An observer of a run that keeps its decisive instants: who sees the hidden car first, when the ego hears of it,
    when it brakes, and how near the two come."""

    def __init__(self, ego: str, hidden: str) -> None:
        self.ego, self.hidden = ego, hidden
        self._knowledge = Knowledge(ego)
        self._times: list[float] = []
        self._where: list[tuple[float, float]] = []
        self._centres: list[float] = []
        self._boxes: list[float] = []
        self._speeds: list[float] = []
        self._met: list[float] = []
        self._found: dict[str, tuple[str, Snapshot]] = {}
        self._least = (math.inf, math.inf)

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
        for kind, absent in (
            ("seen", f"nobody ever sees {self.hidden}"),
            ("heard", f"{self.ego} never hears of {self.hidden}"),
            ("braked", f"{self.ego} never brakes for it"),
            ("closest", "the two are never there together"),
        ):
            title, snapshot = self._found.get(kind, (absent, None))
            moments.append(Moment(kind, title, snapshot and _portable(snapshot)))
        return Story(
            self.ego,
            self.hidden,
            tuple(moments),
            tuple(self._met),
            tuple(self._centres),
            tuple(self._boxes),
            tuple(self._speeds),
        )

    def _measure(self, ego: list[float], hidden: list[float], snapshot: Snapshot) -> None:
        centre, box = math.dist(ego[:2], hidden[:2]), box_distance(ego, hidden)
        self._met.append(snapshot.time)
        self._centres.append(centre)
        self._boxes.append(box)
        self._speeds.append(float(snapshot.view.speed[snapshot.view.row(self.ego)]))
        touching = self._least[0] == 0.0
        if not touching and (box, centre) < self._least:
            self._least = (box, centre)
            title = f"{self.hidden} hits {self.ego}" if box == 0.0 else f"closest, {box:.2f} m apart"
            self._found["closest"] = (title, snapshot)

    def _notice(self, frame: Frame, snapshot: Snapshot) -> None:
        if "seen" not in self._found:
            watchers = [name for name, step in frame.steps.items() if self._shows(step.detections)]
            if watchers:
                self._found["seen"] = (f"{' and '.join(watchers)} {_verb(watchers)} {self.hidden}", snapshot)
        step = frame.steps.get(self.ego)
        if step is None:
            return
        if "heard" not in self._found:
            senders = [
                received.message.sender
                for received in step.inbox
                if received.message.sender != self.ego and self._shows(received.message.detections)
            ]
            if senders:
                self._found["heard"] = (f"{self.ego} hears of it from {' and '.join(senders)}", snapshot)
        if "braked" not in self._found and step.plan is not None and step.plan.braking is not None:
            self._found["braked"] = (f"{self.ego} brakes", snapshot)

    def _shows(self, detections: Detections) -> bool:
        """Whether one of the boxes lies where the hidden car was at the time of the measurement."""
        row = min(bisect.bisect_left(self._times, detections.time - 1e-9), len(self._where) - 1)
        x, y = self._where[row]
        return any(math.hypot(box[0] - x, box[1] - y) <= NEAR for box in detections.boxes.tolist())


def _portable(snapshot: Snapshot) -> Snapshot:
    """The same with a view that holds nothing but its arrays: what a view caches does not travel between processes."""
    return dataclasses.replace(snapshot, view=dataclasses.replace(snapshot.view))


def _verb(names: list[str]) -> str:
    return "sees" if len(names) == 1 else "see"
