"""Topics of Foxglove in an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.imports import optional_import
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
    WORLD,
    Color,
    Foxglove,
    escaped,
    frame_of,
    set_rotation,
    set_stamp,
    set_vector,
)
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.files.atomic import atomic_output, create
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import SnapshotBuilder

_OWN: Color = (0.2, 0.8, 0.9, 0.35)
_RECEIVED: Color = (0.95, 0.6, 0.15, 0.35)
_FUSED: Color = (0.6, 0.9, 0.3, 0.35)


@dataclass(frozen=True)
class Entry:
    """Message on a topic: of protobuf, or the text of a JSON object."""

    topic: str
    message: Any


class Topics:
    """Messages of the frames of a run, in order."""

    def __init__(self, foxglove: Foxglove, run: RecordedRun) -> None:
        self._foxglove = foxglove
        self._run = run
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

    def of_frame(self, frame: Frame) -> Iterator[Entry]:
        """Yield the messages of the next frame."""
        self._time = time = frame.view.time
        if not self._begun:
            self._begun = True
            if self._run.roads is not None:
                yield Entry("/map", map_scene(self._foxglove, self._run.roads, time))
        yield Entry("/tf", self._transforms(frame))
        yield Entry("/ground_truth", self._actors.build(frame))
        for row, name in enumerate(frame.view.names):
            yield Entry(f"/metrics/actors/{escaped(name)}", actor_numbers(frame.view, row))
        for name in frame.steps:
            self._snapshots.setdefault(name, SnapshotBuilder(name))
        yield from self._of_stations(frame)
        if frame.links:
            yield Entry("/messages", link_scene(self._foxglove, frame))
        for message in self._log.of_frame(frame):
            yield Entry("/log", message)
        for message in self._log.of_links(frame.links, time):
            yield Entry("/log/messages", message)
        yield from self._of_cameras(frame)

    def at_end(self) -> Iterator[Entry]:
        """Yield the messages after the last frame."""
        for message in self._log.of_links(self._final_links, self._time):
            yield Entry("/log/messages", message)
        for message in self._log.at_end(self._time):
            yield Entry("/log", message)

    def _of_stations(self, frame: Frame) -> Iterator[Entry]:
        """Yield the messages of the stations. Scenes of those that have left, or drive no longer, are deleted."""
        former, self._shown = self._shown, {}
        for name, builder in self._snapshots.items():
            snapshot = builder.observe(frame)
            if name in frame.steps:
                lists = [(received.message.sender, received.message.detections) for received in snapshot.received]
                for entry in self._of_station(frame, name, frame.steps[name], lists):
                    if isinstance(entry.message, self._foxglove.scene):
                        self._shown[entry.topic] = None
                    yield entry
        for topic in former:
            if topic not in self._shown:
                yield Entry(topic, box_scene(self._foxglove, (), _OWN, frame.view.time))

    def _of_station(
        self, frame: Frame, name: str, step: AgentStep, received: list[tuple[str, Detections]]
    ) -> Iterator[Entry]:
        time, base = frame.view.time, f"/stations/{escaped(name)}"
        for part, lists, color in (
            ("detections", [("detections", step.detections)], _OWN),
            ("received", received, _RECEIVED),
            ("fused", [("fused", step.fused)], _FUSED),
        ):
            yield Entry(f"{base}/{part}", box_scene(self._foxglove, lists, color, time))
        if step.control is not None:
            height = float(frame.view.position[frame.view.row(name), 2]) if name in frame.view else 0.0
            yield Entry(f"{base}/plan", plan_scene(self._foxglove, step.plan, self._run.roads, height, time))
        yield Entry(f"/metrics/stations/{escaped(name)}", station_numbers(step))
        for message in step.outbox:
            if message.points is not None:
                yield Entry(f"{base}/points", self._points(message.points.points(), time))
        if self._has_reference and name in frame.view:
            fix = self._fix(frame, name)
            if fix is not None:
                yield Entry(f"{base}/fix", fix)

    def _of_cameras(self, frame: Frame) -> Iterator[Entry]:
        time, pictures = frame.view.time, self._images.at(frame.view.tick)
        shown = {(picture.station, picture.camera) for picture in pictures}
        for camera in self._images.cameras:
            if (camera.station, camera.name) in shown:
                topic = f"/stations/{escaped(camera.station)}/{escaped(camera.name)}/calibration"
                yield Entry(topic, calibration_message(self._foxglove, camera, time))
        for picture in pictures:
            topic = f"/stations/{escaped(picture.station)}/{escaped(picture.camera)}/image"
            try:
                yield Entry(topic, image_message(self._foxglove, picture, time))
            except (OSError, ValueError) as error:
                self._run.warnings.append(f"{picture.path}: the image is omitted: {error}")

    def _transforms(self, frame: Frame) -> Any:
        view = frame.view
        message = self._foxglove.transforms()
        for name, state in zip(view.names, view.states, strict=True):
            transform = message.transforms.add(parent_frame_id=WORLD, child_frame_id=frame_of(name))
            set_stamp(transform.timestamp, view.time)
            set_vector(transform.translation, (state.x, state.y, state.z))
            set_rotation(transform.rotation, state.yaw, state.pitch, state.roll)
        add_camera_transforms(message, self._images.cameras, iter(view.names), view.time)
        return message

    def _points(self, points: Any, time: float) -> Any:
        message = self._foxglove.point_cloud(frame_id=WORLD, point_stride=12)
        set_stamp(message.timestamp, time)
        set_vector(message.pose.position, (0.0, 0.0, 0.0))
        set_rotation(message.pose.orientation, 0.0)
        for index, axis in enumerate("xyz"):
            message.fields.add(name=axis, offset=4 * index, type=self._foxglove.field.FLOAT32)
        message.data = np.ascontiguousarray(points, dtype="<f4").tobytes()
        return message

    def _fix(self, frame: Frame, name: str) -> Any | None:
        assert self._run.roads is not None
        x, y, z = frame.view.position[frame.view.row(name)].tolist()
        try:
            latitude, longitude = self._run.roads.geodetic(x, y)
        except InputError as error:
            self._has_reference = False
            self._run.warnings.append(f"there is no geographic position: {error.diagnostics[0]}")
            return None
        message = self._foxglove.location_fix(
            frame_id=frame_of(name),
            latitude=float(np.degrees(latitude)),
            longitude=float(np.degrees(longitude)),
            altitude=z + self._run.roads.header.offset[2],
        )
        set_stamp(message.timestamp, frame.view.time)
        return message


_JSON = {"/metrics/actors/": ("eidrive.ActorMetrics", ACTOR), "/metrics/stations/": ("eidrive.StationMetrics", STATION)}
"""Name and fields of the schemas of JSON messages, by the start of the topic."""
_METADATA = ("scenario", "seed", "command", "eidrive-scenario")
"""Entries of the metadata of the run that are copied."""


def write_foxglove(run: RecordedRun, path: Path) -> None:
    """Write a run as an MCAP file with the schemas of Foxglove.

    Raise SettingError if a library is missing, or if the file cannot be written.
    """
    check_foxglove()
    with atomic_output(path) as partial, create(partial) as stream:
        _write(run, stream)


def check_foxglove() -> None:
    """Raise SettingError if a library is missing."""
    Foxglove()
    _register_function()


def _register_function() -> Any:
    return optional_import("mcap_protobuf.schema", "export").register_schema


def _write(run: RecordedRun, stream: BinaryIO) -> None:
    from mcap.writer import CompressionType, Writer

    writer = Writer(stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="", library="eidrive-scenario")
    metadata = run.recording.metadata
    writer.add_metadata("run", {name: metadata[name] for name in _METADATA if name in metadata})
    topics = FoxgloveTopics(writer, run)
    for frame in run.frames():
        topics.add(frame)
    topics.finish()
    writer.finish()  # type: ignore[no-untyped-call]


class FoxgloveTopics:
    """Topics of Foxglove in a file, each registered with its first message.

    writer  writer of an MCAP file
    run     run whose frames are added in order

    Raise SettingError if a library is missing.
    """

    def __init__(self, writer: Any, run: RecordedRun) -> None:
        self._writer = writer
        self._run = run
        self._register = _register_function()
        self._topics = Topics(Foxglove(), run)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._time = 0.0

    def add(self, frame: Frame) -> None:
        """Add the messages of a frame."""
        self._time = frame.view.time
        for entry in self._run.converted(frame, self._topics.of_frame):
            self._add(entry)

    def finish(self) -> None:
        """Add the messages after the last frame."""
        for entry in self._topics.at_end():
            self._add(entry)

    def _add(self, entry: Entry) -> None:
        data = entry.message if isinstance(entry.message, bytes) else entry.message.SerializeToString()
        if entry.topic not in self._channels:
            self._channels[entry.topic] = self._channel(entry)
        instant = max(round(self._time * 1e9), 0)
        self._writer.add_message(self._channels[entry.topic], instant, data, instant)

    def _channel(self, entry: Entry) -> int:
        encoding = "json" if isinstance(entry.message, bytes) else "protobuf"
        number: int = self._writer.register_channel(entry.topic, encoding, self._schema(entry))
        return number

    def _schema(self, entry: Entry) -> int:
        if isinstance(entry.message, bytes):
            name, fields = next(schema for start, schema in _JSON.items() if entry.topic.startswith(start))
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", json_schema(name, fields))
            return self._schemas[name]
        kind = type(entry.message)
        name = kind.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = self._register(self._writer, kind)
        return self._schemas[name]
