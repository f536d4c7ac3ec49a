"""Scenes of vehicles around a station, with sensor readings of the simulated world."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import SensorSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.weather import Weather

Size = tuple[float, float, float]
CAR: Size = (4.892, 1.837, 1.49)
SIZES: Mapping[str, Size] = {
    "car": CAR,
    "truck": (8.468, 2.891, 3.827),
    "van": (5.9, 2.0, 2.6),
    "bus": (12.0, 2.6, 3.2),
    "motorbike": (2.2, 0.8, 1.6),
    "pedestrian": (0.5, 0.5, 1.75),
}
WHEELS = frozenset({"car", "truck", "van", "bus"})


@dataclass(frozen=True)
class Thing:
    """An object by its box center and heading."""

    name: str
    x: float
    y: float
    yaw: float = 0.0
    kind: str = "car"
    dimensions: Size | None = None

    @property
    def size(self) -> Size:
        return self.dimensions or SIZES[self.kind]

    @property
    def box(self) -> np.ndarray:
        return np.array([self.x, self.y, self.size[2] / 2, *self.size, self.yaw])

    def turned(self, angle: float) -> Thing:
        """Return the object in a scene rotated about the origin."""
        cos, sin = math.cos(angle), math.sin(angle)
        return replace(self, x=cos * self.x - sin * self.y, y=sin * self.x + cos * self.y, yaw=self.yaw + angle)

    def mirrored(self) -> Thing:
        """Return the object in a scene mirrored at the x axis."""
        return replace(self, y=-self.y, yaw=-self.yaw)


def spec_of(thing: Thing) -> ActorSpec:
    height = thing.size[2] / 2
    wheelbase = 0.6 * thing.size[0] if thing.kind in WHEELS else 0.0
    shape = "box" if thing.kind == "misc" else thing.kind
    return ActorSpec(thing.name, shape, thing.kind, thing.size, (0.0, 0.0, height), wheelbase=wheelbase)


MAST = ActorSpec("Mast", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))


def readings(
    things: list[Thing],
    sensors: Mapping[str, SensorSettings],
    *,
    mast: tuple[float, float, float] | None = None,
    weather: Weather | None = None,
) -> Readings:
    """Return the readings of the first object at time 0, or of a mast at x, y, yaw."""
    with World(None, dt=0.05, picture_maker=picture_maker) as world:
        world.set_weather(weather or Weather())
        station = spec_of(things[0]) if mast is None else MAST
        if mast is not None:
            world.add(MAST, Placement(mast[0], mast[1], yaw=mast[2]))
        for thing in things:
            world.add(spec_of(thing), Placement(thing.x, thing.y, yaw=thing.yaw))
        return Rig(station, dict(sensors), seed=1).read(world, world.view())


@dataclass(frozen=True)
class Street:
    """Helpers for the tests of this folder."""

    thing = Thing
    readings = staticmethod(readings)
    spec = staticmethod(spec_of)
    mast = MAST


@pytest.fixture
def street() -> Street:
    return Street()
