"""A recorded run as one HTML file: play, pause, scrub; from above, as any of its stations knows it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recording
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.report import reported
from eidrive_scenario.reporting.road_drawing import recorded_roads
from eidrive_scenario.reporting.snapshot import Knowledge, Snapshot
from eidrive_scenario.reporting.top_view import (
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

COLOURS = {
    "own": OWN,
    "received": RECEIVED,
    "link": LINK,
    "lost": LOST,
    "area": AREA,
    "ground": GROUND,
}


def write_replay(recording: Recording, out: Path, result: Mapping[str, Any] | None = None) -> Path:
    """The replay of a recording in the file `out`, which is returned, with the verdicts of its `result` if it is given.

    Raises InputError if the recording holds no frame, or the result is none.
    """
    data = replay_data(recording.frames(), recorded_roads(recording))
    if not data["times"]:
        raise InputError(Problem("the recording holds no frame", "record the run again", str(recording.path)))
    name = recording.scenario or recording.path.stem
    return write_page(
        out,
        "replay.html.jinja",
        title=f"{name}, seed {recording.seed}",
        result=None if result is None else reported(result),
        facts=_facts(recording),
        data=data,
    )


def _facts(recording: Recording) -> dict[str, str]:
    """What the page tells of the run beside the pictures; each scenario parameter in a line of its own."""
    facts = {name: text for name, text in recording.metadata.items() if name not in ("format", "parameters")}
    parameters = json.loads(recording.metadata.get("parameters", "{}"))
    return facts | {f"${name}": _shortly(str(value)) for name, value in parameters.items()}


def _shortly(text: str) -> str:
    """A number with six digits at most, as those that a seed draws have sixteen; other texts as they are."""
    try:
        number = float(text)
    except ValueError:
        return text
    return f"{number:.6g}" if len(text) > len(f"{number:.6g}") and math.isfinite(number) else text


def replay_data(frames: Iterable[Frame], roads: RoadDrawing | None = None) -> dict[str, Any]:
    """What the page's script draws, as plain lists; lengths in metres to a centimetre, angles to a milliradian.

    actors   by name: category and size; poses[frame][name] = x, y, yaw of the box centre, speed
    stations by name, for each frame: own and heard boxes [x, y, l, w, yaw], links [sender, delivered], plan's reason
    changes  [time, path, after, why] of the storyboard's transitions
    """
    actors: dict[str, dict[str, Any]] = {}
    times: list[float] = []
    poses: list[dict[str, list[float]]] = []
    changes: list[list[Any]] = []
    knowledge: dict[str, Knowledge] = {}
    stations: dict[str, list[dict[str, Any] | None]] = {}
    for index, frame in enumerate(frames):
        view = frame.view
        times.append(round(view.time, 4))
        boxes, speeds = view.boxes.tolist(), view.speed.tolist()
        for name, category, box in zip(view.names, view.categories, boxes, strict=True):
            actors.setdefault(name, {"category": category, "size": [round(size, 2) for size in box[3:5]]})
        poses.append(
            {
                name: [round(box[0], 2), round(box[1], 2), round(box[6], 3), round(speed, 2)]
                for name, box, speed in zip(view.names, boxes, speeds, strict=True)
            }
        )
        for name in frame.steps:
            if name not in knowledge:
                knowledge[name] = Knowledge(name)
                stations[name] = [None] * index
        for name, known in knowledge.items():
            snapshot = known.observe(frame)
            stations[name].append(_station(snapshot) if name in frame.steps else None)
        changes.extend(
            [round(change.time, 4), change.path, change.after.value.removesuffix("State"), change.why]
            for change in frame.changes
            if change.transition is not None
        )
    return {
        "times": times,
        "actors": actors,
        "poses": poses,
        "stations": stations,
        "changes": changes,
        "roads": _roads(roads or RoadDrawing()),
        "colours": COLOURS,
    }


def _station(snapshot: Snapshot) -> dict[str, Any]:
    plan = snapshot.step.plan if snapshot.step else None
    return {
        "own": _boxes(snapshot.own),
        "heard": [box for heard in snapshot.heard for box in _boxes(heard.message.detections)],
        "links": [[event.sender, event.outcome == "delivered"] for event in snapshot.links],
        "plan": plan.reason if plan else "",
    }


def _boxes(detections: Detections) -> list[list[float]]:
    return [
        [round(x, 2), round(y, 2), round(length, 2), round(width, 2), round(yaw, 3)]
        for x, y, _, length, width, _, yaw in detections.boxes.tolist()
        if math.isfinite(x + y + yaw)
    ]


def _roads(roads: RoadDrawing) -> dict[str, Any]:
    return {
        "lanes": [[LANES.get(kind, LANE), polygon.round(2).tolist()] for kind, polygon in roads.lanes],
        "lines": [
            [is_broken(kind), PAINT.get(colour, WHITE), line.round(2).tolist()] for kind, colour, line in roads.markings
        ],
    }
