"""Frames of a recording as the plain lists that the script of a replay draws."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec
import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import counted
from eidrive_scenario.recording.frame import Frame, MessagesInFlight
from eidrive_scenario.recording.integrity import DamageReport
from eidrive_scenario.reporting.drawing.canvas import ellipse_of_95_percent
from eidrive_scenario.reporting.replay.light import LightChanges
from eidrive_scenario.reporting.replay.models import ActorModels
from eidrive_scenario.reporting.replay.series import SeriesBuilder, rounded
from eidrive_scenario.reporting.run_report.settings_text import shorten
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS, SnapshotBuilder, StationSnapshot
from eidrive_scenario.storyboard.state.element_states import ElementState, StateChange
from eidrive_scenario.v2x.messages.message import LinkEvent, Message
from eidrive_scenario.v2x.statistics.link_statistics import ABSENT
from eidrive_scenario.world.view import WorldView

MOST = 40_000
"""Maximum number of messages in a page."""
Row = list[float | str | None]
_OF_SIGNAL = frozenset({"sensing", "propagation", "jamming", "collision"})
"""Reasons of losses for which the line of sight matters."""


class MessageList:
    """Messages in the order of their outcomes: [sent, sender, receiver, arrives or None if it is lost, reason, size,
    content].

    Times are in s, sizes in bytes. The reason is that of a loss, with the bodies in the line of sight. Messages of a
    station to itself are omitted. `omitted` is the number of messages after the first MOST, `count` that of the others.
    """

    def __init__(self) -> None:
        self._rows: list[Row] = []
        self._contents: dict[tuple[str, int], str] = {}
        self._indices: dict[LinkEvent, int] = {}
        self._taken = 0
        self._lost: list[int] = []
        self._texts: dict[str, str] = {}
        """Contents, each once, as most messages of a run have equal ones."""
        self.count = 0
        self.omitted = 0

    def observe_sent(self, messages: Iterable[Message]) -> None:
        """Note the contents of sent messages. Their outcomes are known later."""
        for message in messages if self.count < MOST else ():
            text = describe_content(message)
            self._contents[message.sender, message.number] = self._texts.setdefault(text, text)

    def observe(self, events: Iterable[LinkEvent]) -> None:
        """Add the outcomes of one frame."""
        for event in events:
            if event.sender == event.receiver or not math.isfinite(event.sent):
                continue
            if self.count >= MOST:
                self.omitted += 1
                continue
            delivered = event.outcome == "delivered" and event.arrives is not None and math.isfinite(event.arrives)
            arrives = round(event.arrives, 3) if delivered and event.arrives is not None else None
            self._indices[event] = self.count
            self._rows.append([
                round(event.sent, 3), event.sender, event.receiver, arrives, "" if delivered else _reason(event),
                event.size, self._contents.get((event.sender, event.number), ""),
            ])  # fmt: skip
            self.count += 1

    def lose(self, events: Iterable[LinkEvent]) -> None:
        """Change messages that were in flight to a station when it left to losses."""
        for index in (self._indices[event] for event in events if event in self._indices):
            self._rows[index][3:5] = None, ABSENT
            self._lost.append(index)

    def take(self) -> list[Row]:
        """Return the messages since the last call."""
        taken, self._taken = self._taken, self.count
        return self._rows[taken:]

    def take_lost(self) -> list[int]:
        """Return the indices of messages that became losses since the last call."""
        lost, self._lost = self._lost, []
        return lost


def describe_content(message: Message) -> str:
    """Return the content of a message: its kind, the number of objects by class, and whatever else it contains."""
    if (frame := message.features) is not None:
        return f"FEATURES, {counted(len(frame.cells), 'cell')}, frame {frame.number + 1} of {frame.count}"
    parts = [message.kind.upper()]
    numbers = Counter(message.detections.classes)
    listed = ", ".join(name if number == 1 else f"{name} ({number})" for name, number in sorted(numbers.items()))
    parts.append(f"{'' if message.objects is None else 'updates of '}{listed or 'no objects'}")
    if message.sensors:
        parts.append("sensor information")
    if message.points is not None:
        parts.append(f"point cloud of {message.points.size} bytes")
    return shorten(", ".join(parts), 200)


def _reason(event: LinkEvent) -> str:
    reason = event.reason or "unknown"
    if reason not in _OF_SIGNAL or event.los in (None, "los"):
        return reason
    return shorten(f"{reason}, behind {', '.join(event.blockers) or 'the ground or a building'}", 200)


class Timeline:
    """Intervals in which the elements of a storyboard were running, by path, in the order of their first start."""

    def __init__(self) -> None:
        self._elements: dict[str, tuple[str, str, list[list[Any]]]] = {}
        """Name, kind and intervals by path; an interval is [start, end or None, reason of the start, of the end]."""
        self._changed: set[str] = set()

    def observe(self, changes: Iterable[StateChange]) -> None:
        """Add the changes of one frame."""
        for change in changes:
            if not math.isfinite(change.time):
                continue
            time = round(change.time, 4)
            starts = change.after is ElementState.RUNNING and change.before is not ElementState.RUNNING
            ends = change.before is ElementState.RUNNING and change.after is not ElementState.RUNNING
            if starts:
                *_, intervals = self._elements.setdefault(change.path, (change.element, change.kind, []))
                intervals.append([time, None, change.why, ""])
                self._changed.add(change.path)
            elif ends and change.path in self._elements:
                *_, intervals = self._elements[change.path]
                intervals[-1][1], intervals[-1][3] = time, change.why
                self._changed.add(change.path)

    def take(self) -> list[list[Any]]:
        """Return [path, name, kind, intervals] of each element with a change since the last call."""
        changed, self._changed = self._changed, set()
        return [[path, *self._elements[path]] for path in self._elements if path in changed] if changed else []


_LARGEST_PAGE = 64 * 2**20
"""Approximate maximum size of the frames in a page [bytes]."""
_ABSENT = len("null, ")
"""Size of the entry of a station for a frame before its first one [bytes]."""
_VALUE = len("12.34, ")
"""Size of a value of a series [bytes]."""
_LEVEL = (0.01, 5e-4)
"""Height [m] and angles [rad] below which an actor is level at height 0."""
PATH_POINTS = 12
"""Maximum number of points of a planned path in the page."""
UNDRAWABLE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""Errors of frames of a damaged recording."""

Data = dict[str, Any]


def describe_error(error: Exception) -> str:
    """Return an error in one line; for an input error its first diagnostic."""
    diagnostics = getattr(error, "diagnostics", None)
    return shorten(str(diagnostics[0]) if diagnostics else f"{type(error).__name__}: {error}", 300)


class ReplayBuilder:
    """Builder of the data of a replay from the frames of a run, which can be taken in parts.

    report    a frame that cannot be drawn is skipped and reported
    settings  of stations, by name; they define the lifetime of reports
    models    of the actors, and their sensors
    light     changes of the light
    """

    def __init__(
        self, report: DamageReport, settings: Mapping[str, AgentSettings], models: ActorModels, light: LightChanges
    ) -> None:
        self._report, self._settings, self._models, self._light = report, settings, models, light
        self._builders: dict[str, SnapshotBuilder] = {}
        self._series, self._messages, self._timeline = SeriesBuilder(), MessageList(), Timeline()
        self._in_flight = MessagesInFlight()
        self._left = _LARGEST_PAGE
        """Number of bytes that the page may still contain."""
        self._width = 0
        """Number of columns of the series."""
        self.actors: set[str] = set()
        """Names of the actors of all frames."""
        self._stations: set[str] = set()
        self._frames = 0
        self._part = _empty_part()
        self.is_full = False
        """Whether the limit of the size of a page is exceeded; later frames have no effect."""

    def observe(self, frame: Frame) -> None:
        """Add a frame."""
        if self.is_full:
            return
        try:
            part = _frame_data(frame, self._builders, self._settings)
            self._series.observe(frame)
        except UNDRAWABLE as error:
            self._report.add("frames cannot be drawn", f"tick {frame.view.tick}: {describe_error(error)}")
            return
        added = len(part["stations"].keys() - self._stations) + self._series.width - self._width
        self._width = self._series.width
        self._left -= _size(part) + _VALUE * self._width + _ABSENT * added * self._frames
        if self._left < 0:
            self.is_full = True
            self._report.add("the recording is too large for one page", f"shown up to {frame.view.time:.2f} s")
            return
        self._append(part, frame)
        self._series.keep()
        for step in frame.steps.values():
            self._messages.observe_sent(step.outbox)
        self.observe_links(frame.links)
        self._messages.lose(self._in_flight.observe(frame))
        self._timeline.observe(frame.changes)

    def observe_links(self, events: Iterable[LinkEvent]) -> None:
        """Add the outcomes of messages: those of a frame, or those that became known in the last tick."""
        if self.is_full:
            return
        complete = not self._messages.omitted
        self._messages.observe(events)
        if complete and self._messages.omitted:
            shown = f"the first {self._messages.count} are shown"
            self._report.add("the page does not show all messages", shown)

    def take(self) -> Data:
        """Return the data of the frames since the last call, in the format of `replay_data`.

        `actors` contains those that are new, `timeline` the elements whose intervals have changed, with all intervals.
        """
        part, self._part = self._part, _empty_part()
        return {
            **part,
            "names": list(part["actors"]),
            "station_names": list(part["stations"]),
            "messages": self._messages.take(),
            "lost": self._messages.take_lost(),
            "timeline": self._timeline.take(),
            "models": self._models.take(),
            "series": self._series.take(),
            "contact": self._series.contact,
            "decisive": self._series.decisive,
        }

    def _append(self, added: Mapping[str, Any], frame: Frame) -> None:
        part = self._part
        before = len(part["times"])
        for key in _LISTS:
            part[key] += added[key]
        for name, actor in added["actors"].items():
            if name not in self.actors:
                self.actors.add(name)
                offset = tuple(frame.view.offset[frame.view.row(name)].round(3).tolist())
                part["actors"][name] = actor | self._models.describe(
                    name, actor["category"], tuple(actor["size"]), offset
                )
        part["light"] += self._light.observe(frame)
        for name, station in added["stations"].items():
            self._stations.add(name)
            part["stations"].setdefault(name, [None] * before).append(station)
        self._frames += 1


def replay_data(
    frames: Iterable[Frame],
    report: DamageReport | None = None,
    settings: Mapping[str, AgentSettings] | None = None,
    final_links: Iterable[LinkEvent] = (),
    models: ActorModels | None = None,
    light: LightChanges | None = None,
) -> Data:
    """Return the frames as plain lists, with lengths in cm and angles in mrad resolution.

    times      of the frames [s], and their ticks
    names, station_names   of the new actors and of the stations, in their order
    actors     category, size [length, width, height], and the values of `ActorModels.describe` by name
    models     see `ActorModels.take`; light  see `light_entry`
    poses      [x, y, yaw of the box center, speed] by frame and name; also [height of the center of the bottom,
               pitch, roll] of actors that are not level at height 0
    stations   by name, for each frame: own boxes, boxes `received` by sender, `fused` boxes with the semi-axes and
               the direction of their 95 % ellipse, and the plan: its reason, path, whether it demands braking, and
               the rows of the fused objects that are the reason. None: absent.
               A box is [x, y, l, w, yaw, h], with the probability of existence as seventh entry if it is estimated,
               None otherwise if more entries follow
    messages   see `MessageList`; lost  indices of those whose receiver left while they were in flight
    timeline   see `Timeline`; series, contact, decisive  see `SeriesBuilder`
    changes    [time, path, name, after, why] of the storyboard transitions
    contacts   [time, name, other name, relative speed at the impact [m/s]] of all contacts

    For `report`, `settings`, `models` and `light` see `ReplayBuilder`; by default, models are those of categories, and
    the light is that of the scenario. `final_links` are the message outcomes of the last tick.
    """
    builder = ReplayBuilder(
        DamageReport() if report is None else report, settings or {}, models or ActorModels(), light or LightChanges()
    )
    for frame in frames:
        builder.observe(frame)
        if builder.is_full:
            break
    builder.observe_links(final_links)
    return builder.take()


def packed(data: Data) -> Data:
    """Return the data without repetitions, as the page contains it: poses by actor, and 0 for an unchanged entry.

    A station has one column for each of its parts. The texts of messages are indices of `texts`.
    """
    names = dict.fromkeys(name for pose in data["poses"] for name in pose)
    poses = {name: _column([pose.get(name) for pose in data["poses"]]) for name in names}
    stations = {}
    for name, steps in data["stations"].items():
        parts = dict.fromkeys(key for step in steps if step is not None for key in step)
        stations[name] = {key: _column([None if step is None else step[key] for step in steps]) for key in parts}
    texts: dict[str, int] = {}
    messages = [
        [texts.setdefault(entry, len(texts)) if isinstance(entry, str) else entry for entry in row]
        for row in data["messages"]
    ]
    return {**data, "poses": poses, "stations": stations, "messages": messages, "texts": list(texts)}


def overlay(data: Data) -> Data:
    """Return what a page shows of a second run over the first: motion, series, plans, contacts and lost messages."""
    plans = {
        name: [None if step is None else {key: step[key] for key in ("plan", "braking")} for step in steps]
        for name, steps in data["stations"].items()
    }
    lost = [row for row in data["messages"] if row[3] is None]
    lists: Data = {key: [] for key in ("lost", "changes", "timeline", "light")}
    return {**data, **lists, "stations": plans, "messages": lost, "models": {}}


_LISTS = ("times", "ticks", "poses", "changes", "contacts", "light")
"""Entries of a part that are lists over frames or over events."""


def _empty_part() -> Data:
    return {**{key: [] for key in _LISTS}, "actors": {}, "stations": {}}


def _column(entries: list[Any]) -> list[Any]:
    """Return the entries with 0 in place of each that equals its predecessor."""
    return [
        0 if index and entry is not None and entry == entries[index - 1] else entry
        for index, entry in enumerate(entries)
    ]


def _frame_data(frame: Frame, builders: dict[str, SnapshotBuilder], settings: Mapping[str, AgentSettings]) -> Data:
    """Return the data of one frame, and update the snapshot builders of the stations."""
    view = frame.view
    boxes, speeds = view.boxes.tolist(), view.speed.tolist()
    bodies = list(zip(view.names, view.categories, boxes, speeds, strict=True))
    shown = [body for body in bodies if math.isfinite(sum(body[2]) + body[3])]
    raised = _raised(view)
    poses = {
        name: [round(box[0], 2), round(box[1], 2), round(box[6], 3), round(speed, 2), *raised.get(name, ())]
        for name, _, box, speed in shown
    }
    for name in frame.steps:
        if name not in builders:
            builders[name] = SnapshotBuilder(name, settings.get(name, DEFAULT_SETTINGS))
    snapshots = {name: builder.observe(frame) for name, builder in builders.items()}
    return {
        "times": [round(view.time, 4)],
        "ticks": [view.tick],
        "actors": {
            name: {"category": category, "size": [round(size, 2) for size in box[3:6]]}
            for name, category, box, _ in shown
        },
        "poses": [poses],
        "stations": {name: _station(snapshots[name]) if name in frame.steps else None for name in builders},
        "changes": [
            [round(change.time, 4), change.path, change.element, change.after.value.removesuffix("State"), change.why]
            for change in frame.changes
            if change.transition is not None and math.isfinite(change.time)
        ],
        "contacts": [
            [round(view.time, 4), contact.first, contact.second, rounded(contact.impact_speed, 2)]
            for contact in view.contacts
        ],
        "light": [],
    }


def _raised(view: WorldView) -> dict[str, list[float]]:
    """Return height of the center of the bottom [m], pitch and roll of the actors that are not level at height 0."""
    (ahead, left, up), half = view.offset.T, view.size[:, 2] / 2.0
    sin, cos = np.sin(view.pitch), np.cos(view.pitch)
    height = view.position[:, 2] - sin * ahead + cos * (np.sin(view.roll) * left + np.cos(view.roll) * (up - half))
    angles = np.column_stack([view.pitch, view.roll])
    is_raised = (np.abs(height) >= _LEVEL[0]) | (np.abs(angles) >= _LEVEL[1]).any(axis=1)
    rows = np.flatnonzero(is_raised & np.isfinite(height) & np.isfinite(angles).all(axis=1)).tolist()
    stances = np.column_stack([height.round(2), angles.round(3)]).tolist()
    return {view.names[row]: stances[row] for row in rows}


def _size(part: Mapping[str, Any]) -> int:
    """Return the size of the data of one frame [bytes]; the page omits repetitions, and contains each actor once."""
    return len(msgspec.json.encode({**part, "actors": None}))


def _station(snapshot: StationSnapshot) -> Data:
    plan = snapshot.step.plan if snapshot.step else None
    received: dict[str, list[list[float | None]]] = {}
    for report in snapshot.received:
        received.setdefault(report.message.sender, []).extend(_boxes(report.message.detections))
    return {
        "own": _boxes(snapshot.own),
        "received": received,
        "fused": _boxes(snapshot.fused, ellipses=True),
        "plan": plan.reason if plan else "",
        "path": _path(plan),
        "braking": plan is not None and plan.braking is not None,
        "cause": [row for row in plan.objects if row < len(snapshot.fused)] if plan else [],
    }


def _path(plan: Plan | None) -> list[list[float]]:
    """Return at most PATH_POINTS points of the planned path."""
    if plan is None or not len(plan.points) or not np.isfinite(plan.points).all():
        return []
    chosen = np.unique(np.linspace(0, len(plan.points) - 1, min(len(plan.points), PATH_POINTS)).round().astype(int))
    points: list[list[float]] = plan.points[chosen, :2].round(2).tolist()
    return points


def _boxes(detections: Detections, *, ellipses: bool = False) -> list[list[float | None]]:
    existence = detections.existence.tolist() or [None] * len(detections)
    boxes: list[list[float | None]] = []
    for row, ((x, y, _, length, width, height, yaw), exists) in enumerate(
        zip(detections.boxes.tolist(), existence, strict=True)
    ):
        if not math.isfinite(x + y + yaw + length + width + height):
            continue
        share = None if exists is None else rounded(exists, 2)
        box = [round(x, 2), round(y, 2), round(length, 2), round(width, 2), round(yaw, 3), round(height, 2)]
        axes = ellipse_of_95_percent(detections.covariance[row]) if ellipses else None
        ellipse = [] if axes is None else [round(axes[0], 2), round(axes[1], 2), round(axes[2], 3)]
        boxes.append([*box, *([share] if share is not None or ellipse else []), *ellipse])
    return boxes
