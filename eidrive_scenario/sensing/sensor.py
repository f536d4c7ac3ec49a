"""Interface of sensors (abstract base class `Sensor`), of their settings, and of the scene that they measure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.extension_settings import settings_type_of, validate_by_kind
from eidrive_scenario.registry import registry
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import Pinhole, Radiance, UndrawnImage
from eidrive_scenario.world.view import RayHits, WorldView
from eidrive_scenario.world.weather import Weather

Point = tuple[float, float, float]


class Scene(Protocol):
    """Part of the world that sensors measure."""

    @property
    def weather(self) -> Weather:
        """Current weather."""

    def raycast(self, origins: Array, targets: Array, *, sensor: str = "") -> RayHits:
        """Cast rays from (M, 3) to (M, 3) [m] for the sensor of this name, from which some actors may be hidden."""

    def scan(
        self, own: int, apex: Array, origins: Array, targets: Array, near: NDArray[np.bool_], *, sensor: str = ""
    ) -> RayHits:
        """Return the same as `raycast` for many rays on lines through one point (3,) of the actor in the row `own`.

        near  (M,) rays that may hit this actor
        """

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
    found: type[Sensor] = registry("sensors").load(kind, Sensor)
    settings_type_of("sensors", kind, found, SensorSettings)
    return found


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
    for kind, found in names.items():
        if len(found) > 1 and sensor_class(kind).unique:
            raise ValueError(f"a station has at most one sensor of kind {kind!r} (got {', '.join(found)})")
