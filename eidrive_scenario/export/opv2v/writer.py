"""Observer of a run that writes its frames as a scenario folder of OPV2V."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rigid_transform, rotation_matrix
from eidrive_scenario.driving.agent_factory import station_sensors
from eidrive_scenario.driving.stack import DrivingStack
from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError, counted
from eidrive_scenario.export.opv2v.frame_files import frame_text, write_file, write_pcd, write_png
from eidrive_scenario.export.opv2v.poses import MIRROR, opv2v_pose
from eidrive_scenario.export.opv2v.reader_limits import ReaderLimits
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import MiscObject
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings
from eidrive_scenario.simulation import RunResult, Simulation
from eidrive_scenario.world import World
from eidrive_scenario.world.view import WorldView

RATE = 10.0
"""Frames per second [Hz]."""
NUMBER_STEP = 2
"""Step of the numbers of successive frames: they count the steps of 0.05 s of the simulator of OPV2V."""
FIRST_ID = 1001
"""Id of the first station. Readers sort folders as texts, so that all ids have four digits."""
ROADSIDE_UNIT = -1
"""Id of a roadside unit. Readers move one negative id to the end, and would take another one as the ego."""
LIDAR = "lidar"
"""Name of the lidar of all stations, unless the sensors are given."""
OPV2V_LIDAR = LidarSettings(
    channels=64, range=120.0, points_per_second=1_300_000, rotation=RATE, upper_fov=5.0, lower_fov=-25.0
)
"""Lidar with the number of channels and points, the range and the field of view of OPV2V."""
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Camera axes (x right, y down, z forward) as columns in a frame of x forward, y left, z up."""
_UNIT_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def check_sensors(sensors: Mapping[str, SensorSettings], source: str = "") -> None:
    """Raise SettingError unless the sensors of all stations are one lidar and any number of cameras, at 10 Hz."""
    kinds = [settings.kind for settings in sensors.values()]
    if kinds.count("lidar") != 1 or set(kinds) - {"lidar", "camera"}:
        message = f"a frame of OPV2V has one lidar and cameras (got {', '.join(kinds) or 'no sensor'})"
        raise SettingError(Diagnostic(message, "give one sensor of kind lidar", source))
    for name, settings in sensors.items():
        if settings.rate not in (None, RATE):
            message = f"sensor {name!r} measures in each frame, at {RATE:g} Hz (got rate {settings.rate:g})"
            raise SettingError(Diagnostic(message, "remove the rate", source))


class Opv2vWriter:
    """Writer of the frames of a run to FOLDER/ID/NUMBER.yaml, .pcd and _cameraN.png, at 10 Hz.

    folder   scenario folder of the dataset
    sensors  sensors of every station; None: a lidar as that of OPV2V, and the cameras of the station

    Its sensors measure in addition to those of the stations, so that the run is the same as without it. A frame that
    a station lacks, because it entered late or left, is removed for all: readers expect equal frames of all stations.
    """

    def __init__(self, folder: Path, sensors: Mapping[str, SensorSettings] | None = None) -> None:
        self.folder = folder
        self.stations: dict[str, int] = {}
        """Id of each station by name, the ego first."""
        self.frames: list[int] = []
        """Numbers of the frames, complete after the run."""
        self.warnings: list[str] = []
        """Reasons why readers may omit something, complete after the run."""
        self._sensors = sensors
        self._ids: dict[str, int] = {}
        self._rigs: dict[str, Rig] = {}
        self._written: dict[str, list[int]] = {}
        self._limits = ReaderLimits()

    def begin(self, simulation: Simulation) -> None:
        """Assign ids.

        Raise SettingError if the scenario has no station, or if ticks do not meet the times of frames.
        """
        self._world: World = simulation.world
        self._stack: DrivingStack = simulation.stack
        self._seed = simulation.seed
        ticks = 1.0 / (RATE * simulation.settings.dt)
        if abs(ticks - round(ticks)) > 1e-6 or round(ticks) < 1:
            message = f"the time step does not divide the interval of frames (got {simulation.settings.dt:g} s)"
            raise SettingError(Diagnostic(message, f"give a fraction of {1.0 / RATE:g} s, such as 0.05"))
        self._ticks = round(ticks)
        scenario = simulation.scenario
        names = list(self._stack.settings)
        if not names:
            hint = "give entities a driving stack by RunSettings.drive NAME"
            raise SettingError(Diagnostic("the scenario has no station", hint, str(scenario.path or "")))
        self._assign_ids(scenario, names)

    def _assign_ids(self, scenario: Scenario, names: Sequence[str]) -> None:
        roadside = [name for name in names if isinstance(scenario.entities[name], MiscObject)]
        numbered = [name for name in names if name not in roadside] + roadside[1:]
        self._ids = {name: FIRST_ID + count for count, name in enumerate(numbered)}
        self.stations = {**self._ids, **dict.fromkeys(roadside[:1], ROADSIDE_UNIT)}
        for name in roadside[1:]:
            self.warnings.append(
                f"roadside unit {name!r} has the id {self._ids[name]} of a vehicle: readers accept one negative id"
            )

    def observe(self, frame: Frame) -> None:
        """Write the frame if it is one of the dataset. Raise OutputError if a file cannot be written."""
        view = frame.view
        if view.tick % self._ticks:
            return
        number = view.tick // self._ticks * NUMBER_STEP
        present = [name for name in self.stations if name in view]
        for name in present:
            if name not in self._rigs:
                sensors = self._sensors_of(name)
                self._rigs[name] = Rig(self._world.spec(name), sensors, seed=self._seed)
                self.warnings += [
                    f"readers project beside the pixels of camera {camera!r} of {name!r}: the format has no distortion"
                    for camera, settings in sensors.items()
                    if isinstance(settings, CameraSettings) and any(settings.distortion)
                ]
        readings = read_all([self._rigs[name] for name in present], self._world, view)
        lidars: dict[str, Array] = {}
        listed: dict[str, list[str]] = {}
        for name in present:
            (cloud,) = readings[name].lidars.values()
            hit_actors = [view.names[row] for row in np.unique(cloud.rows[cloud.rows >= 0]).tolist()]
            lidars[name] = cloud.pose
            listed[name] = [other for other in hit_actors if view.categories[view.rows[other]] not in _NO_VEHICLES]
            step = frame.steps.get(name)
            estimate = None if step is None else step.estimate
            content = self._content(view, name, hit_actors, readings[name], estimate)
            self._write(number, name, readings[name], cloud, content)
        # Frames that lack a station are omitted later, and readers find the ego in each of the others.
        if len(present) == len(self.stations):
            objects = dict.fromkeys(other for names in listed.values() for other in names)
            self._limits.observe(lidars, listed, {other: _corners(view, view.rows[other]) for other in objects})

    def _sensors_of(self, station: str) -> Mapping[str, SensorSettings]:
        if self._sensors is not None:
            return {name: settings.model_copy(update={"rate": None}) for name, settings in self._sensors.items()}
        own = station_sensors(self._stack.settings[station])
        cameras = {
            name: sensor.model_copy(update={"rate": None})
            for name, sensor in own.items()
            if isinstance(sensor, CameraSettings)
        }
        return {LIDAR if LIDAR not in cameras else f"{LIDAR} of the dataset": OPV2V_LIDAR, **cameras}

    def _id(self, name: str) -> int:
        if name not in self._ids:
            self._ids[name] = FIRST_ID + len(self._ids)
        return self._ids[name]

    def _content(
        self, view: WorldView, name: str, hit_actors: Sequence[str], readings: Readings, estimate: EgoState | None
    ) -> dict[str, Any]:
        """Return the content of the YAML of a station; its objects are the actors that its lidar hits.

        Poses are those below the centers of boxes, extents half lengths, widths and heights [m], speeds are in km/h.
        `ego_extent`, `pedestrians` and `obj_type` are additions to OPV2V.
        """
        row = view.rows[name]
        (cloud,) = readings.lidars.values()
        objects: dict[str, dict[int, dict[str, Any]]] = {"pedestrians": {}, "vehicles": {}}
        for other in hit_actors:
            category = view.categories[view.rows[other]]
            if other != name and category != "misc":
                kind = "pedestrians" if category == "pedestrian" else "vehicles"
                objects[kind][self._id(other)] = _object(view, view.rows[other])
        cameras = enumerate(readings.cameras.values())
        return {
            **{f"camera{number}": _camera(camera, cloud.pose) for number, camera in cameras},
            "ego_extent": (view.size[row] / 2.0).tolist(),
            "ego_speed": _speed(view, row),
            "lidar_pose": opv2v_pose(cloud.pose),
            "plan_trajectory": [],
            "predicted_ego_pos": opv2v_pose(_base_pose(view, row, estimate)),
            "true_ego_pos": opv2v_pose(_base_pose(view, row)),
            **{kind: dict(sorted(entries.items())) for kind, entries in objects.items()},
        }

    def _write(
        self, number: int, name: str, readings: Readings, cloud: LidarReading, content: Mapping[str, Any]
    ) -> None:
        folder = self.folder / str(self.stations[name])
        write_pcd(folder / f"{number:06d}.pcd", cloud.points * MIRROR.diagonal()[:3], cloud.intensity)
        for camera_number, camera in enumerate(readings.cameras.values()):
            write_png(folder / f"{number:06d}_camera{camera_number}.png", camera.rgb)
        write_file(folder / f"{number:06d}.yaml", frame_text(content).encode())
        self._written.setdefault(name, []).append(number)

    def conclude(self, result: RunResult) -> None:
        """Remove the frames that a station lacks. Raise SimulationError if none is left."""
        present = [set(numbers) for numbers in self._written.values()]
        common = set.intersection(*present) if present else set()
        if not common:
            raise SimulationError("no frame has all stations: the dataset would be empty")
        absent = [name for name in self.stations if name not in self._written]
        if absent:
            self.warnings.append(f"stations never enter and have no folder: {', '.join(absent)}")
        removed = set.union(*present) - common
        if removed:
            verb = "is" if len(removed) == 1 else "are"
            self.warnings.append(f"{counted(len(removed), 'frame')} {verb} omitted, in which a station is absent")
        for name in self._written:
            folder = self.folder / str(self.stations[name])
            for path in [path for number in removed for path in folder.glob(f"{number:06d}[._]*")]:
                path.unlink()
        self.stations = {name: number for name, number in self.stations.items() if name in self._written}
        self.frames = sorted(common)
        self.warnings += self._limits.warnings()

    def close(self) -> None:
        """Do nothing: each file is complete once it is written."""


_NO_VEHICLES = frozenset({"misc", "pedestrian"})
"""Categories that are no vehicles."""


def _center_pose(view: WorldView, row: int, estimate: EgoState | None = None) -> Array:
    """Return the pose (4, 4) of the center of the box of an actor, the assumed one if an estimate is given."""
    if estimate is None:
        position, angles = view.position[row], (view.yaw[row], view.pitch[row], view.roll[row])
    else:
        position, angles = estimate.position, (estimate.yaw, estimate.pitch, estimate.roll)
    turn = rotation_matrix(*angles)
    return rigid_transform(turn, position + turn @ view.offset[row])


def _base_pose(view: WorldView, row: int, estimate: EgoState | None = None) -> Array:
    """Return the pose (4, 4) of the point below the center of the box, see `_center_pose`."""
    pose = _center_pose(view, row, estimate)
    pose[2, 3] -= view.size[row, 2] / 2.0
    return pose


def _corners(view: WorldView, row: int) -> Array:
    """Return the corners (8, 3) of the box of an actor."""
    pose = _center_pose(view, row)
    corners: Array = pose[:3, 3] + (_UNIT_CORNERS * view.size[row] / 2.0) @ pose[:3, :3].T
    return corners


def _speed(view: WorldView, row: int) -> float:
    """Return the speed of an actor [km/h]."""
    return 3.6 * float(np.linalg.norm(view.velocity[row]))


def _object(view: WorldView, row: int) -> dict[str, Any]:
    x, y, z, *angles = opv2v_pose(_base_pose(view, row))
    extent = (view.size[row] / 2.0).tolist()
    return {
        "angle": angles,
        "center": [0.0, 0.0, extent[2]],
        "extent": extent,
        "location": [x, y, z],
        "obj_type": view.categories[row],
        "speed": _speed(view, row),
    }


def _camera(reading: CameraReading, lidar: Array) -> dict[str, Any]:
    """Return pose, matrix (4, 4) from the lidar to the camera in left-handed axes, and (3, 3) of the lens [px]."""
    pose = reading.pose.copy()
    pose[:3, :3] = pose[:3, :3] @ _OPTICAL.T
    extrinsic = MIRROR @ np.linalg.inv(pose) @ lidar @ MIRROR
    return {"cords": opv2v_pose(pose), "extrinsic": extrinsic.tolist(), "intrinsic": reading.intrinsics.tolist()}
