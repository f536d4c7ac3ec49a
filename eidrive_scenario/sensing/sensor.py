"""Interface of sensors (abstract base class `Sensor`): settings, mounting, and the scene that they measure."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, Self

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.geometry import rigid_transform, rotation_matrix
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import settings_type_of, validate_by_kind
from eidrive_scenario.sensing.settings import CameraSettings, Mount, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import Pinhole, Radiance, UndrawnImage
from eidrive_scenario.world.surfaces import Surfaces
from eidrive_scenario.world.view import RayHits, WorldView
from eidrive_scenario.world.weather import Weather

ABOVE_ROOF = 0.41
"""Height of a roof sensor above the body: 1.90 m on a car of 1.49 m [m]."""
AHEAD_OF_BUMPER = 0.054
"""Distance of the front camera ahead of the body: 2.5 m ahead of the center of a car of 4.892 m [m]."""

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Camera axes (x right, y down, z forward) as columns in a frame of x forward, y left, z up."""


class Mounting(msgspec.Struct, frozen=True):
    """Pose of a sensor in the frame of the actor: position [m], yaw to the left and pitch downwards [rad]."""

    x: float
    y: float
    z: float
    yaw: float = 0.0
    pitch: float = 0.0

    @property
    def heading(self) -> float:
        """Direction of the sensor in the plane of the body, in [-pi, pi]: opposite to the yaw if it is upside down."""
        return math.remainder(self.yaw if math.cos(self.pitch) >= 0.0 else self.yaw + math.pi, math.tau)

    def position(self, view: WorldView, row: int) -> tuple[float, float, float]:
        """Return the position in the world [m]."""
        x, y, z, yaw, pitch, roll, *_ = view.states[row]
        if pitch or roll:
            along, aside, up = (rotation_matrix(yaw, pitch, roll) @ (self.x, self.y, self.z)).tolist()
            return x + along, y + aside, z + up
        cos, sin = math.cos(yaw), math.sin(yaw)
        return x + cos * self.x - sin * self.y, y + sin * self.x + cos * self.y, z + self.z

    def pose(self, view: WorldView, row: int) -> Array:
        """Return the pose (4, 4) sensor to world, sensor frame x forward, y left, z up."""
        return self._pose(view.position[row], rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row]))

    def camera_pose(self, view: WorldView, row: int) -> Array:
        """Return the pose (4, 4) camera to world, camera frame x right, y down, z forward."""
        return _optical(self.pose(view, row))

    def level_camera_pose(self, x: float, y: float, z: float, yaw: float) -> Array:
        """Return the pose of `camera_pose` on an actor on level ground at this place [m] with this heading [rad]."""
        return _optical(self._pose(np.array([x, y, z]), rotation_matrix(yaw)))

    def _pose(self, position: Array, body: Array) -> Array:
        position = position + body @ (self.x, self.y, self.z)
        return rigid_transform(body @ rotation_matrix(self.yaw, self.pitch), position)


def _optical(pose: Array) -> Array:
    pose[:3, :3] = pose[:3, :3] @ _OPTICAL
    return pose


def mounting(settings: SensorSettings, spec: ActorSpec, usual: str) -> Mounting:
    """Return the mounting that the settings select on this body; `usual` is the default of the kind of sensor.

    The named mounts are those of EI-Drive on a Lincoln MKZ, transferred to other bodies: they are relative to the
    center of the outline of the body, at ground level. On a body without wheels (a mast) all are at its top.
    """
    mount = settings.mount if settings.mount is not None else usual
    if isinstance(mount, Mount):
        return Mounting(mount.x, mount.y, mount.z, math.radians(mount.yaw), math.radians(mount.pitch))
    center_x, center_y, center_z = spec.offset
    top = center_z + spec.size[2] / 2.0
    yaw = math.radians({"left": 100.0, "right": -100.0, "back": 180.0}.get(mount, 0.0))
    if not spec.has_wheels:
        return Mounting(center_x, center_y, top, yaw)
    x, y, z = {
        "front": (spec.size[0] / 2.0 + AHEAD_OF_BUMPER, 0.0, 1.0),
        "left": (0.0, 0.3, top + ABOVE_ROOF - 0.1),
        "right": (0.0, -0.3, top + ABOVE_ROOF - 0.1),
        "back": (-2.0, 0.0, top + ABOVE_ROOF - 0.1),
        "roof": (-0.5, 0.0, top + ABOVE_ROOF),
    }[mount]
    return Mounting(center_x + x, center_y + y, z, yaw)


def nominal_range(settings: SensorSettings) -> float:
    """Return the setting `range` of a sensor [m]; inf if it has none."""
    return getattr(settings, "range", math.inf)


def view_sectors(
    sensors: Iterable[SensorSettings], spec: ActorSpec, range_of: Callable[[SensorSettings], float] = nominal_range
) -> tuple[ViewSector, ...]:
    """Return the sectors of sensors on a body. A sensor without a setting for its opening angle covers all directions.

    range_of  returns the range of a sensor [m]
    """
    sectors = []
    for settings in sensors:
        mount = mounting(settings, spec, "front" if isinstance(settings, CameraSettings) else "roof")
        half = math.radians(getattr(settings, "fov", getattr(settings, "field_of_view", 360.0))) / 2.0
        if isinstance(settings, CameraSettings) and any(settings.distortion):
            edges = np.array([[-math.tan(half), 0.0], [math.tan(half), 0.0]])
            # The nearer of the rays at the side edges of the image
            half = math.atan(float(np.abs(undistorted(edges, np.eye(3), settings.distortion)[:, 0]).min()))
        sectors.append(ViewSector(mount.x, mount.y, mount.z, mount.heading, half, range_of(settings)))
    return tuple(sectors)


def undistorted(positions: Array, intrinsics: Array, distortion: Sequence[float] | Array) -> Array:
    """Return image positions (N, 2) [px] in the plane at distance 1 from an undistorted camera, exact to 1e-9."""
    import cv2

    same, until = np.eye(3), (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    rays = cv2.undistortPointsIter(positions[:, None], intrinsics, np.array(distortion), same, same, until)
    return np.asarray(rays, dtype=float)[:, 0]


Point = tuple[float, float, float]


class Scene(Protocol):
    """Part of the world that sensors measure."""

    @property
    def weather(self) -> Weather:
        """Current weather."""

    def raycast(self, origins: Array, targets: Array, *, sensor: str = "") -> RayHits:
        """Cast rays from (M, 3) to (M, 3) [m] for the sensor of this name, from which some actors may be hidden."""

    def spec(self, name: str) -> ActorSpec:
        """Return the specification of an actor."""

    def motion(self, name: str) -> str:
        """Return the motion of a pedestrian by the standard; empty if it is not specified."""

    def surfaces(self) -> Surfaces:
        """Return the surfaces of the ground and of all static objects."""

    def first_hit(self, origins: Sequence[Sequence[float]], targets: Sequence[Sequence[float]]) -> Sequence[int]:
        """Return the same rows as `raycast`, for a few rays in scalar arithmetic."""

    def is_free(self, own: int, origin: Point, target: int) -> bool:
        """Return True if certainly nothing is between a point of an actor and the box of another, by their rows."""

    def radiance(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> Radiance:
        """Return the light that a camera receives; pose (4, 4) camera to world, x right, y down, z forward."""

    def image(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> UndrawnImage:
        """Return the same image before it is drawn. It shows the current time, also if it is drawn later."""


class Sensor(ABC):
    """Sensor of one station. Built as `cls(settings, spec, name, seed)` when the station enters the world.

    A class is registered in the entry points `eidrive_scenario.sensors` under the `kind` of its settings. Its readings
    are in `Readings.others[kind][name]`. Random numbers are drawn by seed, station, name and tick.
    """

    settings_type: ClassVar[type[SensorSettings]]
    """Type of the settings of this kind of sensor; its field `kind` has the registered name as default."""
    unique: ClassVar[bool] = False
    """Whether a station has at most one sensor of this kind."""

    def __init__(self, settings: SensorSettings, spec: ActorSpec, name: str, seed: int = 0) -> None:
        self.settings = settings
        self.spec = spec
        self.name = name
        self.seed = seed

    @property
    def error_subject(self) -> str:
        """Station that errors of the sensor name."""
        return f"station {self.spec.name!r}"

    @classmethod  # noqa: B027 - an optional hook
    def check_settings(cls, settings: SensorSettings) -> None:
        """Raise SettingError, before the run, if valid settings of this type still permit no sensor."""

    @abstractmethod
    def read(self, scene: Scene, view: WorldView, row: int) -> Any:
        """Return the reading of the sensor on the actor in this row of the view."""

    @classmethod
    def read_batch(cls, sensors: Sequence[Self], rows: Sequence[int], scene: Scene, view: WorldView) -> Sequence[Any]:
        """Return the readings of several sensors of this class, on the actors in these rows."""
        return [sensor.read(scene, view, row) for sensor, row in zip(sensors, rows, strict=True)]


def sensor_class(kind: str) -> type[Sensor]:
    """Return the class of a kind of sensor. Raise RegistryError if its `settings_type` is invalid."""
    sensor_type: type[Sensor] = registry("sensors").load(kind, Sensor)
    settings_type_of("sensors", kind, sensor_type, SensorSettings)
    return sensor_type


def default_sensor(kind: str) -> SensorSettings:
    """Return the default settings of a kind of sensor."""
    return sensor_class(kind).settings_type(kind=kind)


def parse_sensor(value: Any) -> Any:
    """Return the settings of one sensor from a mapping with its kind."""
    return validate_by_kind("sensors", value, SensorSettings, Sensor) if isinstance(value, Mapping) else value


def check_unique(sensors: Mapping[str, SensorSettings]) -> None:
    """Raise ValueError if there are several sensors of a kind of which a station has at most one."""
    names: dict[str, list[str]] = {}
    for name, settings in sensors.items():
        names.setdefault(settings.kind, []).append(name)
    for kind, of_kind in names.items():
        if len(of_kind) > 1 and sensor_class(kind).unique:
            raise ValueError(f"a station has at most one sensor of kind {kind!r} (got {', '.join(of_kind)})")
