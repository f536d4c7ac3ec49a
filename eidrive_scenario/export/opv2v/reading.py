"""Reading of scenario folders of OPV2V as recorded scenes. Files of others are read within limits."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
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
    MobileStation,
    RoadsideStation,
    Track,
    TrafficScene,
    assumed_size,
    folder_name,
)
from eidrive_scenario.files.bounded import read_regular_file, reason_of
from eidrive_scenario.files.yaml_text import MAX_YAML, key_lines, load_yaml

FRAME_STEP = 0.05
"""Time between successive frame numbers [s]."""
MAX_FRAMES = 100_000
"""Maximum number of frames of all stations of a scenario."""
_STATION = re.compile(r"-?\d{1,9}", re.ASCII)
_FRAME = re.compile(r"(\d{1,9})\.yaml", re.ASCII)
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d{1,3}", re.ASCII)
"""Number such as 1e-05 or 1.5e3, which is text in YAML 1.1 and a number for readers of OPV2V."""
_HINT = "give a folder of OPV2V: SCENARIO/ID/NUMBER.yaml"


def scenario_folders(folder: Path) -> list[Path]:
    """Return the scenario folders in a folder of OPV2V, or the folder itself if it is one; [] for another folder."""
    if _stations(folder):
        return [folder]
    return sorted(path for path in folder.iterdir() if path.is_dir() and _stations(path))


def _stations(folder: Path) -> list[Path]:
    """Return the folders of the stations of a scenario with frames, ordered by id."""
    return sorted(filter(_frames, _numbered_folders(folder)), key=lambda path: int(path.name))


def _numbered_folders(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.is_dir() and _STATION.fullmatch(path.name)]


def _frames(station: Path) -> dict[int, Path]:
    """Return the files of the frames of a station by number."""
    numbered = {int(match[1]): path for path in station.iterdir() if (match := _FRAME.fullmatch(path.name))}
    return dict(sorted(numbered.items()))


class _FrameFile:
    """YAML file of a frame. Raise SettingError with file and line for missing and invalid values."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._text = read_regular_file(path, 4 * MAX_YAML).decode("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = "the file is not text in UTF-8" if isinstance(error, UnicodeDecodeError) else reason_of(error)
            raise SettingError(Diagnostic(f"cannot read: {reason}", _HINT, str(path))) from error
        data = load_yaml(self._text, source=str(path), quote=False)
        if not isinstance(data, Mapping):
            self.fail("", "no mapping of keys")
        self.data: Mapping[Any, Any] = data

    def fail(self, key: str, message: str) -> NoReturn:
        """Raise SettingError at a key, whose parts are separated by dots."""
        lines = key_lines(self._text)
        while key and key not in lines:
            key = key.rpartition(".")[0]
        raise SettingError(Diagnostic(message, _HINT, str(self._path), lines.get(key)))

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
    """Samples of a road user by frame number: pose (4, 4) of the center of its box; size and category of the first."""

    category: str
    size: tuple[float, float, float]
    poses: dict[int, Array] = field(default_factory=dict)


def read_scene(folder: Path) -> TrafficScene:
    """Return the scene of a scenario folder: all objects of all stations, and the stations.

    The box of a station is that of other stations, of `ego_extent`, or that of a usual car. Its pose is
    `true_ego_pos`, or follows from its lidar. Raise SettingError for damaged files.
    """
    stations = {int(path.name): _frames(path) for path in _stations(folder)}
    if sum(map(len, stations.values())) > MAX_FRAMES:
        raise SettingError(Diagnostic(f"more than {MAX_FRAMES} frames", "give parts of the folder", str(folder)))
    first = min(min(frames) for frames in stations.values())
    last = max(max(frames) for frames in stations.values())
    objects: dict[int, _Samples] = {}
    lidars: dict[int, dict[int, Array]] = {}
    own: dict[int, dict[int, Array]] = {}
    extents: dict[int, tuple[float, float, float]] = {}
    for station, frames in stations.items():
        lidars[station], own[station] = {}, {}
        for number, path in frames.items():
            file = _FrameFile(path)
            lidars[station][number] = pose_matrix(file.numbers(file.data, "lidar_pose", 6))
            if "vehicles" not in file.data:
                file.fail("", "vehicles is missing")
            if "ego_extent" in file.data and station not in extents:
                extents[station] = file.size(file.data, "ego_extent")
            if "true_ego_pos" in file.data:
                own[station][number] = pose_matrix(file.numbers(file.data, "true_ego_pos", 6))
            for key in ("vehicles", "pedestrians"):
                _read_objects(file, key, number, objects)
    warnings = _add_stations(objects, lidars, own, extents)
    empty = sorted(path.name for path in _numbered_folders(folder) if int(path.name) not in stations)
    warnings += [f"folder {name} has no frame NUMBER.yaml, so that its station is missing" for name in empty]

    def seconds(number: int) -> float:
        return (number - first) * FRAME_STEP

    tracks = [_track(_name(number, lidars), samples, seconds) for number, samples in sorted(objects.items())]
    mobile = [
        MobileStation(_name(number, lidars), _relative(objects[number], lidars[number]))
        for number in lidars
        if number >= 0
    ]
    roadside = [
        RoadsideStation(f"RoadsideUnit{-number}", next(iter(lidars[number].values())))
        for number in lidars
        if number < 0
    ]
    return TrafficScene(folder_name(folder), seconds(last), tracks, mobile, roadside, warnings)


def _read_objects(file: _FrameFile, key: str, frame: int, objects: dict[int, _Samples]) -> None:
    for number, content, path in file.objects(key):
        size = file.size(content, "extent", path)
        category = content.get("obj_type", "pedestrian" if key == "pedestrians" else "")
        samples = objects.setdefault(number, _Samples(category if category in CLASSES else "", size))
        location, center = (file.numbers(content, name, 3, path) for name in ("location", "center"))
        angle = file.numbers(content, "angle", 3, path)
        # The offset of the center is along the axes of the map, as readers of OPV2V add it.
        samples.poses[frame] = pose_matrix([*np.add(location, center).tolist(), *angle])


def _add_stations(
    objects: dict[int, _Samples],
    lidars: Mapping[int, Mapping[int, Array]],
    own: Mapping[int, Mapping[int, Array]],
    extents: Mapping[int, tuple[float, float, float]],
) -> list[str]:
    """Add the poses of the vehicles with a lidar, which their files do not list, and return warnings."""
    warnings = []
    for station, poses in lidars.items():
        if station < 0:
            continue
        if station not in objects:
            if station in extents:
                objects[station] = _Samples("", extents[station])
            else:
                warnings.append(assumed_size(f"station {station}"))
                objects[station] = _Samples("car", STATION_SIZE)
        samples = objects[station]
        if len(own[station]) < len(poses):
            warnings.append(f"station {station}: frames lack true_ego_pos, which is derived from lidar_pose")
        for number, lidar in poses.items():
            base = own[station].get(number)
            if base is None:
                base = lidar.copy()
                base[2, 3] -= LIDAR_HEIGHT
            center = base.copy()
            center[2, 3] += samples.size[2] / 2.0
            samples.poses.setdefault(number, center)
    return warnings


def _name(number: int, stations: Mapping[int, object]) -> str:
    return f"Station{number}" if number in stations else f"Vehicle{number}"


def _track(name: str, samples: _Samples, seconds_of: Callable[[int], float]) -> Track:
    numbers = sorted(samples.poses)
    times = np.array([seconds_of(number) for number in numbers])
    return Track(name, samples.category, samples.size, times, np.stack([samples.poses[number] for number in numbers]))


def _relative(samples: _Samples, lidars: Mapping[int, Array]) -> Array:
    """Return the pose (4, 4) of a lidar relative to the center of the box of its vehicle, in the first frame."""
    number, lidar = next(iter(lidars.items()))
    relative: Array = np.linalg.inv(samples.poses[number]) @ lidar
    return relative
