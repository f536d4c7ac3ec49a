"""Reading of cooperative recordings of DAIR-V2X-C (https://github.com/AIR-THU/DAIR-V2X, data/README.md) as scenes.

The world of DAIR-V2X is right-handed, in meters and radians, and its boxes are given by their corners in it. The labels
have no identities: those of successive frames are associated here, unless they have a `track_id` as those of V2X-Seq.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.assignment import associate
from eidrive_scenario.base.geometry import rigid_transform, rotation_matrix
from eidrive_scenario.errors import Diagnostic, SettingError, counted, quoted
from eidrive_scenario.export.traffic_recording.scene import (
    LIDAR_HEIGHT,
    MAX_NUMBER,
    OUT_OF_RANGE,
    STATION_SIZE,
    LidarStation,
    Track,
    TrafficScene,
    assumed_size,
    folder_name,
)
from eidrive_scenario.files.bounded import MIB, load_json, read_regular_file, reason_of

INDEX = PurePosixPath("cooperative/data_info.json")
"""Index of the pairs of frames; a folder with it is one of DAIR-V2X-C."""
LABELS = PurePosixPath("cooperative/label_world")
VEHICLE, INFRASTRUCTURE = "vehicle-side", "infrastructure-side"
VEHICLE_NAME, UNIT_NAME = "Station1", "RoadsideUnit1"
GATE = 2.5
"""Maximum distance of a labeled box from the predicted position of a road user [m]."""
MAX_GAP = 0.6
"""Time without a label after which a road user is another one [s]."""
_LARGEST = 64 * MIB
_MAX_VALUES = 2_000_000
_CATEGORIES = {
    "car": "car",
    "van": "van",
    "truck": "truck",
    "bus": "bus",
    "pedestrian": "pedestrian",
    "cyclist": "bicycle",
    "tricyclist": "bicycle",
    "motorcyclist": "motorbike",
    "barrowlist": "pedestrian",
}
"""Category of this project by the type of a label, in lower case; labels of other types are no road users."""
_HINT = "give a folder of DAIR-V2X-C: cooperative, vehicle-side, infrastructure-side"


class _JsonFile:
    """JSON file of a recording. Raise SettingError with the file and the key for missing and invalid values."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.data = load_json(read_regular_file(path, _LARGEST), _MAX_VALUES, max_depth=20)
        except (OSError, ValueError) as error:
            raise SettingError(Diagnostic(f"cannot read: {reason_of(error)}", _HINT, str(path))) from error

    def fail(self, message: str) -> NoReturn:
        raise SettingError(Diagnostic(message, _HINT, str(self.path)))

    def entries(self) -> list[Mapping[str, Any]]:
        """Return the objects of a file that is a list of them."""
        if not isinstance(self.data, list) or not all(isinstance(entry, dict) for entry in self.data):
            self.fail("no list of objects")
        return self.data

    def value(self, owner: Any, key: str, kinds: tuple[type, ...], path: str = "") -> Any:
        """Return the value of a key if it has one of these types."""
        value = owner.get(key) if isinstance(owner, dict) else None
        if not isinstance(value, kinds) or isinstance(value, bool):
            given = f"is {quoted(value, 100)}" if isinstance(owner, dict) and key in owner else "is missing"
            self.fail(f"{path}{key} {given}")
        return value

    def array(self, owner: Any, key: str, shape: tuple[int, ...], path: str = "") -> Array:
        """Return a list of numbers, which may be nested, as an array."""
        value = self.value(owner, key, (list,), path)
        try:
            numbers = np.array(value, dtype=float).reshape(shape)
        except (TypeError, ValueError, OverflowError):
            self.fail(f"{path}{key} is {quoted(value, 100)} (expected {math.prod(shape)} numbers)")
        if not (np.abs(numbers) <= MAX_NUMBER).all():
            self.fail(f"{path}{key} {OUT_OF_RANGE}")
        return numbers

    def pose(self, owner: Any, path: str = "") -> Array:
        """Return the pose (4, 4) of a rotation and a translation."""
        turn, position = self.array(owner, "rotation", (3, 3), path), self.array(owner, "translation", (3,), path)
        if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-2:
            self.fail(f"{path}rotation is no rotation matrix")
        return rigid_transform(turn, position)


@dataclass(frozen=True)
class _Frame:
    """Pair of frames of one sequence at a time [s]: the names of its files, and the correction (2,) of the unit [m]."""

    sequence: str
    time: float
    vehicle: str
    unit: str
    label: str
    offset: Array


@dataclass(frozen=True)
class _Label:
    """Labeled box: pose (4, 4) of its center, and its size [m]; identity, or "" without one."""

    category: str
    identity: str
    size: tuple[float, float, float]
    pose: Array


@dataclass
class _OpenTrack:
    """Labels of a road user up to now."""

    category: str
    identity: str
    times: list[float] = field(default_factory=list)
    labels: list[_Label] = field(default_factory=list)

    def add(self, time: float, label: _Label) -> None:
        self.times.append(time)
        self.labels.append(label)

    def predict(self, time: float) -> Array:
        """Return the position (2,) at a time at constant velocity."""
        last: Array = self.labels[-1].pose[:2, 3]
        if len(self.labels) < 2:
            return last
        before = self.labels[-2].pose[:2, 3]
        moved: Array = last + (last - before) * (time - self.times[-1]) / (self.times[-1] - self.times[-2])
        return moved


def is_dair_v2x(folder: Path) -> bool:
    """Return whether a folder is one of DAIR-V2X-C."""
    return (folder / INDEX).is_file()


def read_scenes(folder: Path) -> Iterator[TrafficScene]:
    """Yield the scene of each sequence of a folder. Raise SettingError for damaged files.

    Pairs of frames without a label file are omitted: the index also lists those of the test data, which are not
    released. The first scene has a warning about them.
    """
    sequences: dict[str, list[_Frame]] = {}
    frames = list(_frames(folder))
    for frame in frames:
        if frame is not None:
            sequences.setdefault(frame.sequence, []).append(frame)
    missing = frames.count(None)
    omitted = f"{missing} of {counted(len(frames), 'pair')} of frames {'is' if missing == 1 else 'are'} omitted"
    warnings = [f"{omitted}: {LABELS} lacks their labels"] if missing else []
    for name, of_sequence in sorted(sequences.items()):
        of_sequence.sort(key=lambda frame: frame.time)
        scene = _scene(folder, f"sequence_{name}" if name else folder_name(folder), of_sequence)
        yield replace(scene, warnings=[*warnings, *scene.warnings])
        warnings = []


def _frames(folder: Path) -> Iterator[_Frame | None]:
    """Yield the pairs of frames of the index, None for one without a label file."""
    side = _JsonFile(folder / VEHICLE / "data_info.json")
    by_id = {PurePosixPath(side.value(entry, "pointcloud_path", (str,))).stem: entry for entry in side.entries()}
    index = _JsonFile(folder / INDEX)
    if not index.entries():
        index.fail("the index has no frame")
    labels = {path.name for path in (folder / LABELS).iterdir()} if (folder / LABELS).is_dir() else set()
    if not labels:
        index.fail(f"{LABELS} has no label file")
    for number, entry in enumerate(index.entries()):
        at = f"[{number}]."
        vehicle = PurePosixPath(index.value(entry, "vehicle_pointcloud_path", (str,), at)).stem
        unit = PurePosixPath(index.value(entry, "infrastructure_pointcloud_path", (str,), at)).stem
        label = PurePosixPath(index.value(entry, "cooperative_label_path", (str,), at)).stem
        if f"{label}.json" not in labels:
            yield None
            continue
        if vehicle not in by_id:
            index.fail(f"{at}vehicle_pointcloud_path: frame {quoted(vehicle)} is not in {VEHICLE}/data_info.json")
        about = by_id[vehicle]
        stamp = side.value(about, "pointcloud_timestamp", (str, int, float))
        try:
            microseconds = float(stamp)
        except (ValueError, OverflowError):
            microseconds = math.nan
        if not math.isfinite(microseconds):
            side.fail(f"pointcloud_timestamp is {quoted(stamp, 100)} (expected microseconds)")
        sequence = "".join(letter if letter.isalnum() else "_" for letter in str(about.get("batch_id", "")))[:40]
        yield _Frame(sequence, microseconds * 1e-6, vehicle, unit, label, _offset(index, entry, at))


def _offset(index: _JsonFile, entry: Mapping[str, Any], at: str) -> Array:
    """Return the correction (2,) of the position of the roadside unit [m]; 0 if the index states none."""
    offset = entry.get("system_error_offset") or {}
    if not isinstance(offset, dict):
        index.fail(f"{at}system_error_offset is {quoted(offset, 100)}")
    values = {"offset": [offset.get("delta_x", 0.0), offset.get("delta_y", 0.0)]}
    return index.array(values, "offset", (2,), f"{at}system_error_")


def _scene(folder: Path, name: str, frames: list[_Frame]) -> TrafficScene:
    start = frames[0].time
    lidars: list[Array] = []
    own: list[_Label | None] = []
    unit: Array | None = None
    open_tracks: list[_OpenTrack] = []
    done: list[_OpenTrack] = []
    times: list[float] = []
    for frame in frames:
        time = round(frame.time - start, 6)
        if times and time - times[-1] < 1e-6:
            continue  # one scan of the vehicle paired with several of the roadside unit
        if time > MAX_NUMBER:
            message = f"pointcloud_timestamp of frame {quoted(frame.vehicle)} is {time:g} s after the first one"
            raise SettingError(Diagnostic(message, "give microseconds", str(folder / VEHICLE / "data_info.json")))
        times.append(time)
        lidars.append(_vehicle_lidar(folder, frame.vehicle))
        if unit is None:
            unit = _unit_lidar(folder, frame)
        labels = _labels(folder, frame)
        own.append(next((label for label in labels if _contains(label, lidars[-1][:2, 3])), None))
        others = [label for label in labels if label is not own[-1]]
        done += [track for track in open_tracks if time - track.times[-1] > MAX_GAP]
        open_tracks = [track for track in open_tracks if time - track.times[-1] <= MAX_GAP]
        open_tracks += _continue(open_tracks, others, time)
    tracks = [_station_track(times, lidars, own)]
    tracks += [_track(number, track) for number, track in enumerate([*done, *open_tracks], 1)]
    mobile = LidarStation(VEHICLE_NAME, np.linalg.inv(tracks[0].poses[0]) @ lidars[0])
    assert unit is not None
    warnings = [] if any(own) else [assumed_size("the vehicle with the lidar")]
    return TrafficScene(name, times[-1], tracks, [mobile], [LidarStation(UNIT_NAME, unit)], warnings)


def _vehicle_lidar(folder: Path, number: str) -> Array:
    """Return the pose (4, 4) of the lidar of the vehicle in a frame."""
    calibration = folder / VEHICLE / "calib"
    sensor = _JsonFile(calibration / "lidar_to_novatel" / f"{number}.json")
    body = _JsonFile(calibration / "novatel_to_world" / f"{number}.json")
    pose: Array = body.pose(body.data) @ sensor.pose(sensor.value(sensor.data, "transform", (dict,)), "transform.")
    return pose


def _unit_lidar(folder: Path, frame: _Frame) -> Array:
    """Return the pose (4, 4) of the lidar of the roadside unit, with the stated correction of its position."""
    file = _JsonFile(folder / INFRASTRUCTURE / "calib" / "virtuallidar_to_world" / f"{frame.unit}.json")
    pose = file.pose(file.data)
    pose[:2, 3] += frame.offset
    return pose


def _labels(folder: Path, frame: _Frame) -> list[_Label]:
    file = _JsonFile(folder / LABELS / f"{frame.label}.json")
    labels = []
    for number, entry in enumerate(file.entries()):
        at = f"[{number}]."
        category = _CATEGORIES.get(file.value(entry, "type", (str,), at).lower())
        if category is None:
            continue
        corners = file.array(entry, "world_8_points", (8, 3), at)
        identity = entry.get("track_id")
        labels.append(_label(file, at, category, "" if identity is None else str(identity), corners))
    return labels


def _label(file: _JsonFile, at: str, category: str, identity: str, corners: Array) -> _Label:
    """Return the box of its corners: bottom and top, each from the front to the rear in a circle."""
    front, rear = corners[[0, 1, 4, 5]].mean(axis=0), corners[[2, 3, 6, 7]].mean(axis=0)
    ahead = front - rear
    length = float(np.linalg.norm(ahead))
    width = float(np.linalg.norm(corners[[0, 3, 4, 7]].mean(axis=0) - corners[[1, 2, 5, 6]].mean(axis=0)))
    height = float(abs(corners[4:, 2].mean() - corners[:4, 2].mean()))
    if min(length, width, height) < 1e-3:
        file.fail(f"{at}world_8_points are no corners of a box")
    pose = rigid_transform(rotation_matrix(math.atan2(ahead[1], ahead[0])), corners.mean(axis=0))
    return _Label(category, identity, (length, width, height), pose)


def _contains(label: _Label, point: Array) -> bool:
    local = (point - label.pose[:2, 3]) @ label.pose[:2, :2]
    return bool((np.abs(local) < np.array(label.size[:2]) / 2.0).all())


def _continue(tracks: list[_OpenTrack], labels: list[_Label], time: float) -> list[_OpenTrack]:
    """Add the labels of a frame to the tracks that they continue, and return tracks of the others."""
    identified = {(track.identity, track.category): track for track in tracks if track.identity}
    started: list[_OpenTrack] = []
    free: list[_Label] = []
    for label in labels:
        # A second label of one identity in a frame is of another road user, or a track would be at two positions.
        track = identified.pop((label.identity, label.category), None)
        if track is not None:
            track.add(time, label)
        elif label.identity:
            started.append(_OpenTrack(label.category, label.identity, [time], [label]))
        else:
            free.append(label)
    for category in dict.fromkeys(label.category for label in free):
        same = [track for track in tracks if track.category == category and not track.identity]
        of_category = [label for label in free if label.category == category]
        predicted = np.array([track.predict(time) for track in same]).reshape(-1, 2)
        pairs = associate(predicted, np.array([label.pose[:2, 3] for label in of_category]), GATE)
        for track_index, label_index in pairs:
            same[track_index].add(time, of_category[label_index])
        continued = {label_index for _, label_index in pairs}
        started += [
            _OpenTrack(category, "", [time], [label])
            for label_index, label in enumerate(of_category)
            if label_index not in continued
        ]
    return started


def _track(number: int, track: _OpenTrack) -> Track:
    poses = np.stack([label.pose for label in track.labels])
    return Track(f"Vehicle{number}", track.category, _size(track.labels), np.array(track.times), poses)


def _size(labels: list[_Label]) -> tuple[float, float, float]:
    """Return the median of the sizes of labels: those of one road user differ."""
    length, width, height = np.median([label.size for label in labels], axis=0).tolist()
    return length, width, height


def _station_track(times: list[float], lidars: list[Array], own: list[_Label | None]) -> Track:
    """Return the track of the vehicle with the lidar: its labels, else a body below its lidar."""
    labeled = [(lidar, label) for lidar, label in zip(lidars, own, strict=True) if label is not None]
    if labeled:
        lidar, label = labeled[0]
        category, size = label.category, _size([label for _, label in labeled])
        relative = np.linalg.inv(lidar) @ label.pose
    else:
        category, size = "car", STATION_SIZE
        relative = np.eye(4)
        relative[2, 3] = size[2] / 2.0 - LIDAR_HEIGHT
    poses = np.stack(lidars) @ relative
    poses[:, :3, :3] = rotation_matrix(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    return Track(VEHICLE_NAME, category, size, np.array(times), poses)
