"""Recordings of given frames, with bodies in any pose and detections in any place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep, Plan
from eidrive_scenario.export.recorded_run import RecordedRun, open_run
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import Control
from eidrive_scenario.world.view import WorldView

Body = Mapping[str, object]
DT = 0.1


def view(bodies: Mapping[str, Body], tick: int = 0) -> WorldView:
    """Return a view of bodies by name; each has `category`, `position`, `angles` (yaw, pitch, roll) and others."""
    defaults: Body = {
        "category": "car",
        "position": (0.0, 0.0, 0.0),
        "angles": (0.0, 0.0, 0.0),
        "velocity": (0.0, 0.0, 0.0),
        "yaw_rate": 0.0,
        "size": (4.0, 2.0, 1.5),
        "offset": (1.4, 0.0, 0.75),
    }
    rows = [{**defaults, **body} for body in bodies.values()]

    def column(key: str, width: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        values = np.array([row[key] for row in rows], dtype=float)
        return values.reshape(len(rows), width) if width else values

    angles = column("angles", 3)
    velocity = column("velocity", 3)
    return WorldView(
        time=tick * DT,
        tick=tick,
        names=tuple(bodies),
        categories=tuple(str(row["category"]) for row in rows),
        position=column("position", 3),
        yaw=angles[:, 0],
        pitch=angles[:, 1],
        roll=angles[:, 2],
        velocity=velocity,
        acceleration=np.zeros((len(rows), 3)),
        yaw_rate=column("yaw_rate", 0),
        speed=np.hypot(velocity[:, 0], velocity[:, 1]),
        size=column("size", 3),
        offset=column("offset", 3),
    )


def detected(
    time: float,
    boxes: Sequence[Sequence[float]],
    velocity: Sequence[Sequence[float]] | None = None,
) -> Detections:
    """Return detections of cars with these boxes, a score of 0.9, and tracks from 1 on."""
    count = len(boxes)
    return Detections(
        time=time,
        boxes=np.array(boxes, dtype=float).reshape(count, 7),
        scores=np.full(count, 0.9),
        classes=("car",) * count,
        velocity=np.full((count, 2), np.nan) if velocity is None else np.array(velocity, dtype=float),
        covariance=np.full((count, 2, 2), np.nan),
        tracks=tuple(range(1, count + 1)),
    )


def step(
    own: Detections,
    fused: Detections | None = None,
    *,
    plan: Plan | None = None,
    drives: bool = True,
    estimate: EgoState | None = None,
) -> AgentStep:
    """Return a step of a station without messages."""
    control = Control() if drives else None
    return AgentStep(own, (), own if fused is None else fused, plan, control, (), estimate)


def write_run(
    folder: Path,
    frames: Iterable[Frame],
    *,
    road: Path | None = None,
    metadata: Mapping[str, str] | None = None,
) -> RecordedRun:
    """Record frames and open the recording as the source of exports."""
    attachments = {} if road is None else {"road.xodr": road.read_bytes()}
    about = {"scenario": "made", "seed": "7", **(metadata or {})}
    recorder = Recorder(folder / "made.mcap", metadata=about, attachments=attachments)
    for frame in frames:
        recorder.observe(frame)
    recorder.close()
    return open_run(folder / "made.mcap")
