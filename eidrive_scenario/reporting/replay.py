"""Replay of a recorded run as one HTML file: top view with the information of a selectable station."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded_json import load_json
from eidrive_scenario.recording.damage import DamageReport
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import Recording
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.reporting.drawing.road_drawing import recorded_roads
from eidrive_scenario.reporting.drawing.top_view import (
    AREA,
    GROUND,
    LANE,
    LANES,
    LINK,
    LOST,
    OWN,
    PAINT,
    RECEIVED,
    WHITE,
    RoadDrawing,
    is_broken,
)
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.run_report.reported_run import parse_run
from eidrive_scenario.reporting.run_report.settings_text import run_facts, shorten
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS, SnapshotBuilder, StationSnapshot
from eidrive_scenario.simulation.recorded_outcome import CONTEXT

_LARGEST_PAGE = 64 * 2**20
"""Approximate maximum size of the frames in a page [bytes]."""
_ABSENT = len("null, ")
"""Size of the entry of a station for a frame before its first one [bytes]."""
COLORS = {
    "own": OWN,
    "received": RECEIVED,
    "link": LINK,
    "lost": LOST,
    "area": AREA,
    "ground": GROUND,
}


@dataclass(frozen=True)
class Replay:
    """Written page, and one line for each kind of damage of its recording."""

    page: Path
    damage: tuple[str, ...]


def make_replay(
    recording: Recording,
    out: Path,
    result: Mapping[str, Any] | None = None,
    *,
    result_file: str | Path = "",
    complete: bool = True,
) -> Replay:
    """Write the replay of a recording to the file `out`, with the verdicts of an optional `result`.

    result_file  file of the result for error messages
    complete     whether the run has ended; the page states that an unfinished run is incomplete

    The readable part of a damaged recording is shown, and the page lists the damage. Raise InputError if no frame can
    be read, or the result is invalid.
    """
    report = DamageReport()
    for line in recording.damage:
        report.add(line)
    trace = TraceHash()
    settings = _settings(recording, report)
    frames, roads = _drawable(recording, report, trace), _recorded_roads(recording, report)
    data = replay_data(frames, roads, report, _station_settings(settings))
    if not data["times"]:
        reason = "; ".join(report.lines()) or "record the run again"
        raise InputError(Diagnostic("the recording contains no readable frame", reason, str(recording.path)))
    if result is not None and result.get("trace_hash") != trace.hexdigest():
        report.add("the result in the folder has another trace hash: its verdicts may belong to another run")
    name = shorten(recording.scenario or recording.path.stem, 200)
    page = write_page(
        out,
        "replay.html.jinja",
        title=f"{name}, seed {recording.seed}",
        result=None if result is None else parse_run(result, result_file),
        facts=_facts(recording, settings),
        settings=json.dumps(settings, indent=1, ensure_ascii=False) if settings else "",
        command=recording.metadata.get("command", ""),
        damage=report.lines(),
        complete=complete,
        data=data,
    )
    return Replay(page, report.lines())


def _drawable(recording: Recording, report: DamageReport, trace: TraceHash) -> Iterator[Frame]:
    """Yield the frames, and add each frame to the trace hash."""
    for frame in recording.frames(lambda reason: report.add("frames cannot be decoded", shorten(reason, 200))):
        try:
            trace.observe(frame)
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            report.add("frames are inconsistent", f"tick {frame.view.tick}: {_describe(error)}")
        yield frame


def _recorded_roads(recording: Recording, report: DamageReport) -> RoadDrawing:
    try:
        return recorded_roads(recording)
    except (InputError, ArithmeticError, LookupError, TypeError, ValueError, MemoryError, RecursionError) as error:
        report.add("roads are not drawn", _describe(error))
        return RoadDrawing()


def _describe(error: Exception) -> str:
    """Return an error in one line; for an input error its first diagnostic."""
    text = str(error.diagnostics[0]) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
    return shorten(text, 300)


def _settings(recording: Recording, report: DamageReport) -> dict[str, Any]:
    """Return the resolved settings of the metadata."""
    settings = _object(recording.metadata.get("settings", "{}"))
    if settings is None:
        report.add("the settings of the run cannot be decoded")
    return settings or {}


def _station_settings(settings: Mapping[str, Any]) -> dict[str, AgentSettings]:
    """Return the settings of stations with a report timeout other than the default."""
    found: dict[str, AgentSettings] = {}
    stations = settings.get("stations")
    for name, station in stations.items() if isinstance(stations, Mapping) else ():
        timeout = station.get("report_timeout") if isinstance(station, Mapping) else None
        if timeout not in (None, DEFAULT_SETTINGS.report_timeout):
            with suppress(ValidationError):  # in a damaged recording
                found[name] = AgentSettings(report_timeout=timeout)
    return found


def _object(text: str) -> dict[str, Any] | None:
    """Parse a JSON object of the metadata. Return None for other texts."""
    try:
        found = load_json(text.encode(), max_depth=30)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _facts(recording: Recording, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the facts about the run that the page lists."""
    if settings:
        return run_facts(settings)
    hidden = ("format", "parameters", "settings", "command", CONTEXT)
    facts = {name: shorten(text) for name, text in recording.metadata.items() if name not in hidden}
    return facts | run_facts({"parameters": _object(recording.metadata.get("parameters", "{}"))})


class _Budget:
    """Limit of the size of a page."""

    def __init__(self, report: DamageReport | None) -> None:
        self._left = _LARGEST_PAGE
        self._report = report

    def take(self, size: int, time: float) -> bool:
        """Reserve a number of bytes. Return False if the limit is exceeded."""
        self._left -= size
        if self._left < 0 and self._report is not None:
            self._report.add("the recording is too large for one page", f"shown up to {time:.2f} s")
        return self._left >= 0


def replay_data(
    frames: Iterable[Frame],
    roads: RoadDrawing | None = None,
    report: DamageReport | None = None,
    settings: Mapping[str, AgentSettings] | None = None,
) -> dict[str, Any]:
    """Return the data of the script of the page as plain lists, with lengths in cm and angles in mrad resolution.

    actors    category and size by name; poses[frame][name] = x, y, yaw of the box center, speed
    stations  by name, for each frame: own and received boxes [x, y, l, w, yaw], with the probability of existence as
              sixth entry if it is estimated; links [sender, delivered]; reason of the plan
    changes   [time, path, after, why] of the storyboard transitions

    With a `report`, a frame that cannot be drawn is skipped and reported. `settings` of stations, by name, define the
    lifetime of reports.
    """
    data: dict[str, Any] = {"times": [], "actors": {}, "poses": [], "stations": {}, "changes": []}
    builders: dict[str, SnapshotBuilder] = {}
    budget = _Budget(report)
    for frame in frames:
        try:
            part = _frame_data(frame, builders, settings or {})
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            if report is None:
                raise
            report.add("frames cannot be drawn", f"tick {frame.view.tick}: {_describe(error)}")
            continue
        added = len(part["stations"].keys() - data["stations"].keys())
        if not budget.take(_size(part) + _ABSENT * added * len(data["times"]), frame.view.time):
            break
        _append(data, part)
    return {**data, "roads": _roads(roads or RoadDrawing()), "colors": COLORS}


def _frame_data(
    frame: Frame, builders: dict[str, SnapshotBuilder], settings: Mapping[str, AgentSettings]
) -> dict[str, Any]:
    """Return the data of one frame, and update the snapshot builders of the stations."""
    view = frame.view
    boxes, speeds = view.boxes.tolist(), view.speed.tolist()
    bodies = list(zip(view.names, view.categories, boxes, speeds, strict=True))
    shown = [body for body in bodies if math.isfinite(sum(body[2]) + body[3])]
    poses = {
        name: [round(box[0], 2), round(box[1], 2), round(box[6], 3), round(speed, 2)] for name, _, box, speed in shown
    }
    for name in frame.steps:
        if name not in builders:
            builders[name] = SnapshotBuilder(name, settings.get(name, DEFAULT_SETTINGS))
    snapshots = {name: builder.observe(frame) for name, builder in builders.items()}
    return {
        "time": round(view.time, 4),
        "actors": {
            name: {"category": category, "size": [round(size, 2) for size in box[3:5]]}
            for name, category, box, _ in shown
        },
        "pose": poses,
        "stations": {name: _station(snapshots[name]) if name in frame.steps else None for name in builders},
        "changes": [
            [round(change.time, 4), change.path, change.after.value.removesuffix("State"), change.why]
            for change in frame.changes
            if change.transition is not None and math.isfinite(change.time)
        ],
    }


def _append(data: dict[str, Any], part: Mapping[str, Any]) -> None:
    before = len(data["times"])
    data["times"].append(part["time"])
    data["poses"].append(part["pose"])
    data["changes"].extend(part["changes"])
    for name, actor in part["actors"].items():
        data["actors"].setdefault(name, actor)
    for name, station in part["stations"].items():
        data["stations"].setdefault(name, [None] * before).append(station)


def _size(part: Mapping[str, Any]) -> int:
    """Return the approximate size of the data of one frame in the page [bytes]."""
    poses = sum(40 + len(name) for name in part["pose"])
    changes = sum(len(path) + len(why) for _, path, _, why in part["changes"])
    stations = sum(
        60
        if station is None
        else 120
        + 40 * (len(station["own"]) + len(station["received"]) + len(station["links"]))
        + sum(len(sender) for sender, _ in station["links"])
        + len(station["plan"])
        for station in part["stations"].values()
    )
    return 40 + poses + changes + stations


def _station(snapshot: StationSnapshot) -> dict[str, Any]:
    plan = snapshot.step.plan if snapshot.step else None
    return {
        "own": _boxes(snapshot.own),
        "received": [box for report in snapshot.received for box in _boxes(report.message.detections)],
        "links": [[event.sender, event.outcome == "delivered"] for event in snapshot.links],
        "plan": plan.reason if plan else "",
    }


def _boxes(detections: Detections) -> list[list[float]]:
    existence = detections.existence.tolist() or [None] * len(detections)
    return [
        [round(x, 2), round(y, 2), round(length, 2), round(width, 2), round(yaw, 3), *_share(exists)]
        for (x, y, _, length, width, _, yaw), exists in zip(detections.boxes.tolist(), existence, strict=True)
        if math.isfinite(x + y + yaw + length + width)
    ]


def _share(existence: float | None) -> list[float]:
    return [] if existence is None or not math.isfinite(existence) else [round(existence, 2)]


def _roads(roads: RoadDrawing) -> dict[str, Any]:
    return {
        "lanes": [[LANES.get(kind, LANE), polygon.round(2).tolist()] for kind, polygon in roads.lanes],
        "lines": [
            [is_broken(kind), PAINT.get(color, WHITE), line.round(2).tolist()] for kind, color, line in roads.markings
        ],
    }
