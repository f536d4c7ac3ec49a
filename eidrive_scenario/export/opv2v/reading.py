"""Reading of scenario folders of OPV2V as recorded scenes. Files of others are read within limits."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import CLASSES
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.export.opv2v.poses import pose_matrix
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
from eidrive_scenario.files.yaml_text import load_yaml_file

FRAME_STEP = 0.05
"""Time between successive frame numbers [s]."""
MAX_FRAMES = 100_000
"""Maximum number of frames of all stations of a scenario."""
MAX_SHIFT = 0.1
"""Motion of the lidar of a roadside unit that counts as standing [m]."""
_STATION = re.compile(r"(-?\d{1,9})", re.ASCII)
_FRAME = re.compile(r"(\d{1,9})\.yaml", re.ASCII)
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d{1,3}", re.ASCII)
"""Number such as 1e-05 or 1.5e3, which is text in YAML 1.1 and a number for readers of OPV2V."""
_HINT = "give a folder of OPV2V: SCENARIO/ID/NUMBER.yaml"


def scenario_folders(folder: Path) -> list[Path]:
    """Return the scenario folders in a folder of OPV2V, or the folder itself if it is one; [] for another folder."""
    if _stations(folder):
        return [folder]
    return sorted(path for path in folder.iterdir() if path.is_dir() and _stations(path))


def _stations(folder: Path) -> dict[int, Path]:
    """Return the folders of the stations of a scenario with frames, ordered by id."""
    return _by_number(filter(_frames, _numbered_folders(folder)), _STATION)


def _numbered_folders(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.is_dir() and _STATION.fullmatch(path.name)]


def _frames(station: Path) -> dict[int, Path]:
    """Return the files of the frames of a station by number."""
    return _by_number(station.iterdir(), _FRAME)


def _by_number(paths: Iterable[Path], pattern: re.Pattern[str]) -> dict[int, Path]:
    """Return the paths with such a name, ordered by number. Raise SettingError if two of them have the same number."""
    numbered: dict[int, Path] = {}
    for path in sorted(paths):
        if match := pattern.fullmatch(path.name):
            other = numbered.setdefault(int(match[1]), path)
            if other is not path:
                message = f"{path.name} has the number of {other.name}"
                raise SettingError(Diagnostic(message, "rename or remove one of them", str(path)))
    return dict(sorted(numbered.items()))


class _FrameFile:
    """YAML file of a frame. Raise SettingError with file and line for missing and invalid values."""

    def __init__(self, path: Path) -> None:
        self._path = path
        data, self._lines = load_yaml_file(path, _HINT)
        if not isinstance(data, Mapping):
            self.fail("", "no mapping of keys")
        self.data: Mapping[Any, Any] = data

    def fail(self, key: str, message: str) -> NoReturn:
        """Raise SettingError at a key, whose parts are separated by dots."""
        while key and key not in self._lines:
            key = key.rpartition(".")[0]
        raise SettingError(Diagnostic(message, _HINT, str(self._path), self._lines.get(key)))

    def numbers(self, owner: Mapping[Any, Any], key: str, count: int, within: str = "") -> tuple[float, ...]:
        """Return a list of numbers."""
        path = f"{within}.{key}" if within else key
        if key not in owner:
            self.fail(within, f"{path} is missing")
        value: Any = owner[key]
        numbers = list(map(_number, value)) if isinstance(value, list) else []
        if len(numbers) != count or not all(isinstance(number, int | float) for number in numbers):
            self.fail(path, f"{path} is {quoted(value, 100)} (expected {count} numbers)")
        if not all(abs(number) <= MAX_NUMBER for number in numbers):  # not of NaN either
            self.fail(path, f"{path} {OUT_OF_RANGE}")
        return tuple(map(float, numbers))

    def size(self, owner: Mapping[Any, Any], key: str, within: str = "") -> tuple[float, float, float]:
        """Return length, width and height from half of them."""
        length, width, height = (2.0 * half for half in self.numbers(owner, key, 3, within))
        if min(length, width, height) <= 0.0:
            path = f"{within}.{key}" if within else key
            self.fail(path, f"{path} is not positive")
        return length, width, height

    def objects(self, key: str) -> Iterator[tuple[int, Mapping[Any, Any], str]]:
        """Yield id, content and path of each object."""
        objects = self.data.get(key)
        if objects is None:
            return
        if not isinstance(objects, Mapping):
            self.fail(key, f"{key} is {quoted(objects, 100)} (expected a mapping of ids to objects)")
        for number, content in objects.items():
            path = f"{key}.{number}"
            if not isinstance(number, int) or isinstance(number, bool) or not isinstance(content, Mapping):
                self.fail(path, f"{path} is no object with an integer as its id")
            yield number, content, path


def _number(value: Any) -> Any:
    """Return the number of a text with an exponent, None for a truth value, and any other value as it is."""
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        return float(value)
    return None if isinstance(value, bool) else value


@dataclass
class _Samples:
    """Samples of a road user by frame number: pose (4, 4) of the center of its box; size and category of the first.

    key  key of the list of its id
    """

    category: str
    size: tuple[float, float, float]
    key: str = "vehicles"
    poses: dict[int, Array] = field(default_factory=dict)


@dataclass
class _Station:
    """Poses (4, 4) of the lidar and of the point below the box by frame number; size of the box if a file states it."""

    lidars: dict[int, Array] = field(default_factory=dict)
    bases: dict[int, Array] = field(default_factory=dict)
    size: tuple[float, float, float] | None = None


def read_scene(folder: Path) -> TrafficScene:
    """Return the scene of a scenario folder: all objects of all stations, and the stations.

    The box of a station is that of other stations, of `ego_extent`, or that of a usual car. Its pose is
    `true_ego_pos`, or follows from its lidar. Raise SettingError for damaged files.
    """
    folders = _stations(folder)
    files = {number: _frames(path) for number, path in folders.items()}
    if sum(map(len, files.values())) > MAX_FRAMES:
        raise SettingError(Diagnostic(f"more than {MAX_FRAMES} frames", "give parts of the folder", str(folder)))
    numbers = sorted({number for frames in files.values() for number in frames})
    objects: dict[int, _Samples] = {}
    stations: dict[int, _Station] = {}
    for name, frames in files.items():
        station = stations[name] = _Station()
        for number, path in frames.items():
            file = _FrameFile(path)
            station.lidars[number] = pose_matrix(file.numbers(file.data, "lidar_pose", 6))
            if "vehicles" not in file.data:
                file.fail("", "vehicles is missing")
            if "ego_extent" in file.data and station.size is None:
                station.size = file.size(file.data, "ego_extent")
            if "true_ego_pos" in file.data:
                station.bases[number] = pose_matrix(file.numbers(file.data, "true_ego_pos", 6))
            for key in ("vehicles", "pedestrians"):
                _read_objects(file, key, number, objects)
    mobile = {number: station for number, station in stations.items() if number >= 0}
    warnings = [text for number, station in mobile.items() for text in _add_station(number, station, objects)]
    empty = sorted(path.name for path in _numbered_folders(folder) if path not in folders.values())
    warnings += [
        f"roadside unit {number} moves by up to {moved:.1f} m, but stays at its first pose in the scenario"
        for number, station in stations.items()
        if number < 0 and (moved := _motion(station)) > MAX_SHIFT
    ]
    warnings += [f"folder {name} has no frame NUMBER.yaml, so that its station is missing" for name in empty]

    def name_of(number: int) -> str:
        return f"Station{number}" if number in stations else f"Vehicle{number}"

    def track(number: int, samples: _Samples) -> Track:
        frames = sorted(samples.poses)
        times = np.array([(frame - numbers[0]) * FRAME_STEP for frame in frames])
        poses = np.stack([samples.poses[frame] for frame in frames])
        return Track(name_of(number), samples.category, samples.size, times, poses)

    def first_lidar(number: int) -> Array:
        return next(iter(stations[number].lidars.values()))

    def relative_lidar(number: int) -> Array:
        first = next(iter(stations[number].lidars))
        relative: Array = np.linalg.inv(objects[number].poses[first]) @ first_lidar(number)
        return relative

    return TrafficScene(
        folder_name(folder),
        (numbers[-1] - numbers[0]) * FRAME_STEP,
        [track(number, samples) for number, samples in sorted(objects.items())],
        [LidarStation(name_of(number), relative_lidar(number)) for number in mobile],
        [LidarStation(f"RoadsideUnit{-number}", first_lidar(number)) for number in stations if number < 0],
        warnings,
    )


def _read_objects(file: _FrameFile, key: str, frame: int, objects: dict[int, _Samples]) -> None:
    for number, content, path in file.objects(key):
        size = file.size(content, "extent", path)
        category = content.get("obj_type", "pedestrian" if key == "pedestrians" else "")
        samples = objects.setdefault(number, _Samples(category if category in CLASSES else "", size, key))
        if samples.key != key:
            file.fail(path, f"{path} has the id of an object in {samples.key}")
        location, center = (file.numbers(content, name, 3, path) for name in ("location", "center"))
        angle = file.numbers(content, "angle", 3, path)
        # The offset of the center is along the axes of the map, as readers of OPV2V add it.
        samples.poses[frame] = pose_matrix([*np.add(location, center).tolist(), *angle])


def _motion(station: _Station) -> float:
    """Return the largest distance of a lidar from its first position [m]."""
    positions = np.stack(list(station.lidars.values()))[:, :3, 3]
    return float(np.linalg.norm(positions - positions[0], axis=1).max())


def _add_station(number: int, station: _Station, objects: dict[int, _Samples]) -> Iterator[str]:
    """Add the poses of a vehicle with a lidar, which its files do not list, and yield warnings."""
    if number not in objects:
        if station.size is None:
            yield assumed_size(f"station {number}")
        objects[number] = _Samples("car", STATION_SIZE) if station.size is None else _Samples("", station.size)
    samples = objects[number]
    if len(station.bases) < len(station.lidars):
        yield f"station {number}: frames lack true_ego_pos, which is derived from lidar_pose"
    for frame, lidar in station.lidars.items():
        center = station.bases.get(frame, lidar).copy()
        if frame not in station.bases:
            center[2, 3] -= LIDAR_HEIGHT
        center[2, 3] += samples.size[2] / 2.0
        samples.poses.setdefault(frame, center)
