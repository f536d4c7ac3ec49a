"""Interface of sensors (abstract base class `Sensor`), and their settings in the properties of a controller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from eidrive_scenario.errors import RegistryError, suggestion
from eidrive_scenario.registry import registry
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.settings import validate_nested
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView


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
    model = getattr(found, "settings_type", None)
    if not (isinstance(model, type) and issubclass(model, SensorSettings)):
        described = registry("sensors").describe(kind)
        raise RegistryError(f"{described}: settings_type is {model!r} (expected a class derived from SensorSettings)")
    return found


def default_sensor(kind: str) -> SensorSettings:
    """Return the default settings of a kind of sensor."""
    return sensor_class(kind).settings_type(kind=kind)


def parse_sensor(value: Any) -> Any:
    """Return the settings of one sensor from a mapping with its kind."""
    if not isinstance(value, Mapping):
        return value
    kind = value.get("kind")
    if not (isinstance(kind, str) and kind in registry("sensors")):
        error = PydanticCustomError("value_error", "{hint}", {"hint": suggestion(str(kind), registry("sensors"))})
        details = InitErrorDetails(type=error, loc=("kind",), input=kind)
        raise ValidationError.from_exception_data("sensor", [details])
    return validate_nested(sensor_class(kind).settings_type, value)
