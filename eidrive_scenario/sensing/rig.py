"""Sensors of one station, and the reading of the sensors of all stations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from eidrive_scenario.sensing.camera import Camera
from eidrive_scenario.sensing.inertial import Gnss, Imu
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings, TruthReading
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.settings import (
    CameraSettings,
    GnssSettings,
    ImuSettings,
    LidarSettings,
    SensorSettings,
    TruthSettings,
)
from eidrive_scenario.sensing.truth import TruthSensor, read_truth
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

Sensor = TruthSensor | Camera | Lidar | Gnss | Imu

_SINGLE = {TruthSensor: "truth sensor", Gnss: "GNSS receiver", Imu: "inertial unit"}
"""Kinds of sensors of which a station has at most one."""


class Rig:
    """Sensors of one actor. A sensor with a rate is read in the first tick of each period.

    `seed` is that of the noise of all sensors. Raise ValueError if there is more than one truth sensor, GNSS receiver
    or IMU.
    """

    def __init__(self, spec: ActorSpec, sensors: Mapping[str, SensorSettings], *, seed: int = 0) -> None:
        self.station = spec.name
        self._sensors: dict[str, Sensor] = {
            name: _sensor(settings, spec, name, seed) for name, settings in sensors.items()
        }
        self._periods: dict[str, int] = {}
        for kind, name in _SINGLE.items():
            if sum(isinstance(sensor, kind) for sensor in self._sensors.values()) > 1:
                raise ValueError(f"sensors: station {spec.name!r} has more than one {name}")

    def read(self, scene: Scene, view: WorldView) -> Readings:
        """Return the ego motion and the readings of due sensors. Raise KeyError if the actor is not in the world."""
        return read_all([self], scene, view)[self.station]

    def due(self, time: float) -> dict[str, Sensor]:
        """Return the sensors to read at `time` [s]; they count as read afterwards."""
        found = {}
        for name, sensor in self._sensors.items():
            rate = sensor.settings.rate
            if rate is not None:
                period = math.floor(time * rate + 1e-6)
                if self._periods.get(name, -1) >= period:
                    continue
                self._periods[name] = period
            found[name] = sensor
        return found


def read_all(rigs: Sequence[Rig], scene: Scene, view: WorldView) -> dict[str, Readings]:
    """Return the readings of several stations, by name; the rays of their truth sensors are cast in one batch."""
    due = [rig.due(view.time) for rig in rigs]
    rows = [view.row(rig.station) for rig in rigs]
    truth_sensors = [
        (index, sensor)
        for index, found in enumerate(due)
        for sensor in found.values()
        if isinstance(sensor, TruthSensor)
    ]
    truth_readings = read_truth(
        [sensor for _, sensor in truth_sensors], [rows[index] for index, _ in truth_sensors], scene, view
    )
    truths = {index: reading for (index, _), reading in zip(truth_sensors, truth_readings, strict=True)}
    return {
        rig.station: _read(found, scene, view, row, truths.get(index))
        for index, (rig, found, row) in enumerate(zip(rigs, due, rows, strict=True))
    }


def _read(
    sensors: Mapping[str, Sensor], scene: Scene, view: WorldView, row: int, truth: TruthReading | None
) -> Readings:
    """Return the readings of one station, given that of its truth sensor."""
    cameras: dict[str, CameraReading] = {}
    lidars: dict[str, LidarReading] = {}
    gnss = imu = None
    for name, sensor in sensors.items():
        if isinstance(sensor, Camera):
            cameras[name] = sensor.read(scene, view, row)
        elif isinstance(sensor, Lidar):
            lidars[name] = sensor.read(scene, view, row)
        elif isinstance(sensor, Gnss):
            gnss = sensor.read(view, row)
        elif isinstance(sensor, Imu):
            imu = sensor.read(view, row)
    return Readings(view.time, ego_state(view, row), truth, cameras, lidars, gnss, imu)


def ego_state(view: WorldView, row: int) -> EgoState:
    """Return the exact motion of the actor."""
    state = view.states[row]
    yaw = state.yaw
    return EgoState(
        time=view.time,
        position=view.position[row],
        yaw=yaw,
        pitch=state.pitch,
        roll=state.roll,
        speed=state.speed,
        yaw_rate=state.yaw_rate,
        acceleration=math.cos(yaw) * state.acceleration_x + math.sin(yaw) * state.acceleration_y,
    )


def _sensor(settings: SensorSettings, spec: ActorSpec, name: str, seed: int) -> Sensor:
    match settings:
        case TruthSettings():
            return TruthSensor(settings, spec, name)
        case CameraSettings():
            return Camera(settings, spec, name, seed)
        case LidarSettings():
            return Lidar(settings, spec, name, seed)
        case GnssSettings():
            return Gnss(settings, spec, name, seed)
        case ImuSettings():
            return Imu(settings, spec, name, seed)
    raise TypeError(f"sensors: unknown type of settings (got {type(settings).__name__})")
