"""Topics of a run: all messages of each frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import InputError
from eidrive_scenario.export.foxglove.cameras import (
    CameraImages,
    add_camera_transforms,
    calibration_message,
    image_message,
)
from eidrive_scenario.export.foxglove.log_messages import RunMessages, actor_numbers, station_numbers
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
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.snapshot import SnapshotBuilder

_OWN: Color = (0.2, 0.8, 0.9, 0.35)
_RECEIVED: Color = (0.95, 0.6, 0.15, 0.35)
_FUSED: Color = (0.6, 0.9, 0.3, 0.35)


class Entry(NamedTuple):
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
                lists = [(one.message.sender, one.message.detections) for one in snapshot.received]
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
            found = message.transforms.add(parent_frame_id=WORLD, child_frame_id=frame_of(name))
            set_stamp(found.timestamp, view.time)
            set_vector(found.translation, (state.x, state.y, state.z))
            set_rotation(found.rotation, state.yaw, state.pitch, state.roll)
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
