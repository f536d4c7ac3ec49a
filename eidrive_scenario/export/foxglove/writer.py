"""Topics of Foxglove in an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import InputError
from eidrive_scenario.export.foxglove.cameras import (
    CameraImages,
    add_camera_transforms,
    calibration_message,
    image_message,
)
from eidrive_scenario.export.foxglove.log_messages import (
    ACTOR,
    STATION,
    RunMessages,
    actor_numbers,
    json_schema,
    station_numbers,
)
from eidrive_scenario.export.foxglove.scene import ActorScene, box_scene, link_scene, map_scene, plan_scene
from eidrive_scenario.export.foxglove.schemas import (
    UPRIGHT,
    WORLD,
    Color,
    Foxglove,
    escaped,
    frame_of,
    rotation,
    stamp,
    vector,
)
from eidrive_scenario.export.mcap_topics import ToolTopics, write_topics
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import SnapshotBuilder

_OWN: Color = (0.2, 0.8, 0.9, 0.35)
_RECEIVED: Color = (0.95, 0.6, 0.15, 0.35)
_FUSED: Color = (0.6, 0.9, 0.3, 0.35)
_JSON = {"/metrics/actors/": ("eidrive.ActorMetrics", ACTOR), "/metrics/stations/": ("eidrive.StationMetrics", STATION)}
"""Name and fields of the schemas of JSON messages, by the start of the topic."""
_METADATA = ("scenario", "seed", "command", "eidrive-scenario")
"""Entries of the metadata of the run that are copied."""
Entry = tuple[str, Any]
"""Topic and message: of protobuf, or the text of a JSON object."""


def write_foxglove(run: RecordedRun, path: Path) -> None:
    """Write a run as an MCAP file with the schemas of Foxglove.

    Raise SettingError if a library is missing, or if the file cannot be written.
    """
    metadata = run.recording.metadata
    write_topics(run, path, FoxgloveTopics, {name: metadata[name] for name in _METADATA if name in metadata})


class FoxgloveTopics(ToolTopics):
    """Topics of Foxglove in a file."""

    def __init__(self, writer: Any, run: RecordedRun) -> None:
        super().__init__(writer, run)
        self._foxglove = foxglove = Foxglove()
        outcome = run.outcome()
        self._final_links = () if outcome is None else outcome.final_links
        self._log = RunMessages(foxglove, () if outcome is None else outcome.criteria)
        self._actors = ActorScene(foxglove)
        self._images = CameraImages(run.recording.path, run.warnings)
        self._snapshots: dict[str, SnapshotBuilder] = {}
        self._shown: dict[str, None] = {}
        """Topics of the scenes of stations in the last frame."""
        self._has_reference = run.roads is not None and bool(run.roads.header.geo_reference)
        self._begun = False
        self._time = 0.0

    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""
        self._time = frame.view.time
        for topic, message in self._run.converted(frame, self._of_frame):
            self.write(topic, message, self._time)

    def finish(self) -> None:
        """Add the messages after the last frame."""
        for message in self._log.of_links(self._final_links, self._time):
            self.write("/log/messages", message, self._time)
        for message in self._log.at_end(self._time):
            self.write("/log", message, self._time)

    def _schema(self, topic: str, message: Any) -> int:
        if not isinstance(message, bytes):
            return super()._schema(topic, message)
        name, fields = next(schema for start, schema in _JSON.items() if topic.startswith(start))
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", json_schema(name, fields))
        return self._schemas[name]

    def _of_frame(self, frame: Frame) -> Iterator[Entry]:
        """Yield the messages of the next frame."""
        frame, time = self._run.with_losses(frame), frame.view.time
        if not self._begun:
            self._begun = True
            if self._run.roads is not None:
                yield "/map", map_scene(self._foxglove, self._run.roads, time)
        yield "/tf", self._transforms(frame)
        yield "/ground_truth", self._actors.build(frame)
        for row, name in enumerate(frame.view.names):
            yield f"/metrics/actors/{escaped(name)}", actor_numbers(frame.view, row)
        for name in frame.steps:
            self._snapshots.setdefault(name, SnapshotBuilder(name))
        yield from self._of_stations(frame)
        if frame.links:
            yield "/messages", link_scene(self._foxglove, frame)
        for message in self._log.of_frame(frame):
            yield "/log", message
        for message in self._log.of_links(frame.links, time):
            yield "/log/messages", message
        yield from self._of_cameras(frame)

    def _of_stations(self, frame: Frame) -> Iterator[Entry]:
        """Yield the messages of the stations. Scenes of those that have left, or drive no longer, are deleted."""
        former, self._shown = self._shown, {}
        for name, builder in self._snapshots.items():
            snapshot = builder.observe(frame)
            if name in frame.steps:
                lists = [(received.message.sender, received.message.detections) for received in snapshot.received]
                for topic, message in self._of_station(frame, name, frame.steps[name], lists):
                    if isinstance(message, self._foxglove.scene):
                        self._shown[topic] = None
                    yield topic, message
        for topic in former:
            if topic not in self._shown:
                yield topic, box_scene(self._foxglove, (), _OWN, frame.view.time)

    def _of_station(
        self, frame: Frame, name: str, step: AgentStep, received: list[tuple[str, Detections]]
    ) -> Iterator[Entry]:
        time, base = frame.view.time, f"/stations/{escaped(name)}"
        for part, lists, color in (
            ("detections", [("detections", step.detections)], _OWN),
            ("received", received, _RECEIVED),
            ("fused", [("fused", step.fused)], _FUSED),
        ):
            yield f"{base}/{part}", box_scene(self._foxglove, lists, color, time)
        if step.control is not None:
            height = float(frame.view.position[frame.view.row(name), 2]) if name in frame.view else 0.0
            yield f"{base}/plan", plan_scene(self._foxglove, step.plan, self._run.roads, height, time)
        yield f"/metrics/stations/{escaped(name)}", station_numbers(step)
        for message in step.outbox:
            if message.points is not None:
                yield f"{base}/points", self._points(message.points.points(), time)
        if self._has_reference and name in frame.view:
            fix = self._fix(frame, name)
            if fix is not None:
                yield f"{base}/fix", fix

    def _of_cameras(self, frame: Frame) -> Iterator[Entry]:
        time, pictures = frame.view.time, self._images.at(frame.view.tick)
        shown = {(picture.station, picture.camera) for picture in pictures}
        for camera in self._images.cameras:
            if (camera.station, camera.name) in shown:
                topic = f"/stations/{escaped(camera.station)}/{escaped(camera.name)}/calibration"
                yield topic, calibration_message(self._foxglove, camera, time)
        for picture in pictures:
            topic = f"/stations/{escaped(picture.station)}/{escaped(picture.camera)}/image"
            try:
                yield topic, image_message(self._foxglove, picture, time)
            except (OSError, ValueError) as error:
                self._run.warnings.append(f"{picture.path}: the image is omitted: {error}")

    def _transforms(self, frame: Frame) -> Any:
        view = frame.view
        message = self._foxglove.transforms()
        for name, state in zip(view.names, view.states, strict=True):
            message.transforms.add(
                timestamp=stamp(view.time),
                parent_frame_id=WORLD,
                child_frame_id=frame_of(name),
                translation=vector((state.x, state.y, state.z)),
                rotation=rotation(state.yaw, state.pitch, state.roll),
            )
        add_camera_transforms(message, self._images.cameras, iter(view.names), view.time)
        return message

    def _points(self, points: Any, time: float) -> Any:
        number = self._foxglove.field.FLOAT32
        return self._foxglove.point_cloud(
            timestamp=stamp(time),
            frame_id=WORLD,
            pose={"position": vector((0.0, 0.0, 0.0)), "orientation": UPRIGHT},
            point_stride=12,
            fields=[{"name": axis, "offset": 4 * index, "type": number} for index, axis in enumerate("xyz")],
            data=np.ascontiguousarray(points, dtype="<f4").tobytes(),
        )

    def _fix(self, frame: Frame, name: str) -> Any | None:
        assert self._run.roads is not None
        x, y, z = frame.view.position[frame.view.row(name)].tolist()
        try:
            latitude, longitude = self._run.roads.geodetic(x, y)
        except InputError as error:
            self._has_reference = False
            self._run.warnings.append(f"there is no geographic position: {error.diagnostics[0]}")
            return None
        return self._foxglove.location_fix(
            timestamp=stamp(frame.view.time),
            frame_id=frame_of(name),
            latitude=float(np.degrees(latitude)),
            longitude=float(np.degrees(longitude)),
            altitude=z + self._run.roads.header.offset[2],
        )
