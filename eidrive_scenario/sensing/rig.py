"""Sensors of one station, and the reading of the sensors of all stations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from eidrive_scenario.extensions.registry import construct
from eidrive_scenario.sensing.readings import FIELDS, EgoState, Readings
from eidrive_scenario.sensing.sensor import Scene, Sensor, check_unique, sensor_class
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView


class Rig:
    """Sensors of one actor. A sensor with a rate is read in the first tick of each period.

    `seed` is that of the noise of all sensors. Raise ValueError if there are several sensors of a kind of which a
    station has at most one.
    """

    def __init__(self, spec: ActorSpec, sensors: Mapping[str, SensorSettings], *, seed: int = 0) -> None:
        check_unique(sensors)
        self.station = spec.name
        self._sensors: dict[str, Sensor] = {
            name: construct(sensor_class(settings.kind), settings, spec, name, seed)
            for name, settings in sensors.items()
        }
        self._periods: dict[str, int] = {}

    def read(self, scene: Scene, view: WorldView) -> Readings:
        """Return the ego motion and the readings of due sensors. Raise KeyError if the actor is not in the world."""
        return read_all([self], scene, view)[self.station]

    def due(self, time: float) -> dict[str, Sensor]:
        """Return the sensors to read at `time` [s]; they count as read afterwards."""
        due = {}
        for name, sensor in self._sensors.items():
            rate = sensor.settings.rate
            if rate is not None:
                period = math.floor(time * rate + 1e-6)
                if self._periods.get(name, -1) >= period:
                    continue
                self._periods[name] = period
            due[name] = sensor
        return due


def read_all(rigs: Sequence[Rig], scene: Scene, view: WorldView) -> dict[str, Readings]:
    """Return the readings of several stations, by name. The sensors of each class are read in one batch."""
    rows = [view.row(rig.station) for rig in rigs]
    groups: dict[type[Sensor], list[tuple[int, str, Sensor]]] = {}
    for index, rig in enumerate(rigs):
        for name, sensor in rig.due(view.time).items():
            groups.setdefault(type(sensor), []).append((index, name, sensor))
    by_kind: list[dict[str, dict[str, Any]]] = [{} for _ in rigs]
    for kind, entries in groups.items():
        values = kind.read_batch(
            [sensor for _, _, sensor in entries], [rows[index] for index, _, _ in entries], scene, view
        )
        for (index, name, sensor), value in zip(entries, values, strict=True):
            by_kind[index].setdefault(sensor.settings.kind, {})[name] = value
    return {rig.station: _readings(by_kind[index], view, rows[index]) for index, rig in enumerate(rigs)}


def _readings(by_kind: Mapping[str, Mapping[str, Any]], view: WorldView, row: int) -> Readings:
    """Return the readings of one station from those of its sensors, by kind and name."""
    truth, gnss, imu = (next(iter(by_kind.get(kind, {}).values()), None) for kind in ("truth", "gnss", "imu"))
    return Readings(
        view.time,
        ego_state(view, row),
        truth,
        by_kind.get("camera", {}),
        by_kind.get("lidar", {}),
        gnss,
        imu,
        others={} if by_kind.keys() <= FIELDS else {kind: by_kind[kind] for kind in by_kind.keys() - FIELDS},
    )


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
