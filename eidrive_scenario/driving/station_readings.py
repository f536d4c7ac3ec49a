"""Readings of the sensors of all stations in one tick."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.signals import SignalSensor
from eidrive_scenario.world import World
from eidrive_scenario.world.view import WorldView


def read_stations(
    rigs: Mapping[str, Rig],
    signal_sensors: Mapping[str, SignalSensor],
    world: World,
    view: WorldView,
    signals: Mapping[str, str],
) -> dict[str, Readings]:
    """Return the readings of each station: its sensors, its trailers, and the signals in its sight.

    signals  states of the traffic signals, by id
    """
    readings = read_all(list(rigs.values()), world, view)
    for name, reading in readings.items():
        attached = [view.row(other) for other in world.attached(name)]
        if attached:
            readings[name] = replace(reading, attached=view.boxes[attached])
    for name, sensor in signal_sensors.items():
        visible = sensor.read(world, view, view.row(name), signals)
        readings[name] = replace(readings[name], signals=visible)
    return readings
