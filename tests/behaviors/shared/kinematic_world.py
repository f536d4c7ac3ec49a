"""World without a physics engine, for tests of single actions and conditions."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.view import WorldView

Vector = tuple[float, float, float]


class KinematicWorld:
    """World without forces: every actor has exactly the placement of the storyboard."""

    def __init__(self, scenario: Scenario, dt: float) -> None:
        self.dt = dt
        self.tick = 0
        self.placements: dict[str, Placement] = {}
        self._entities = scenario.entities
        self._velocity: dict[str, Vector] = {}
        self._acceleration: dict[str, Vector] = {}

    def add(self, additions: Mapping[str, Placement]) -> None:
        for name, placement in additions.items():
            self.placements[name] = placement
            self._velocity[name] = _along(placement)
            self._acceleration[name] = (0.0, 0.0, 0.0)

    def remove(self, names: set[str]) -> None:
        for name in names:
            self.placements.pop(name, None)

    def move(self, placements: Mapping[str, Placement], driven: Collection[str] = ()) -> None:
        for name in [name for name in self.placements if name in placements or name not in driven]:
            before = self.placements[name]
            after = placements.get(name) or replace(before, speed=0.0, teleport=False, across=True)
            velocity = self._rate(_position(before), _position(after))
            if after.teleport or not after.across:
                velocity = _along(after)
            self._acceleration[name] = self._rate(self._velocity[name], velocity)
            self._velocity[name] = velocity
            self.placements[name] = after
        self.tick += 1

    def _rate(self, before: Vector, after: Vector) -> Vector:
        return (after[0] - before[0]) / self.dt, (after[1] - before[1]) / self.dt, (after[2] - before[2]) / self.dt

    def view(self) -> WorldView:
        names = tuple(self.placements)
        rows = [self.placements[name] for name in names]
        boxes = [self._entities[name].bounding_box for name in names]
        count = len(names)
        return WorldView(
            time=self.tick * self.dt,
            tick=self.tick,
            names=names,
            categories=("car",) * count,
            position=np.array([_position(p) for p in rows]).reshape(count, 3),
            yaw=np.array([p.yaw for p in rows]),
            pitch=np.array([p.pitch for p in rows]),
            roll=np.array([p.roll for p in rows]),
            velocity=np.array([self._velocity[name] for name in names]).reshape(count, 3),
            acceleration=np.array([self._acceleration[name] for name in names]).reshape(count, 3),
            yaw_rate=np.zeros(count),
            speed=np.array([p.speed for p in rows]),
            size=np.array([[b.dimensions.length, b.dimensions.width, b.dimensions.height] for b in boxes]).reshape(
                count, 3
            ),
            offset=np.array([[b.center.x, b.center.y, b.center.z] for b in boxes]).reshape(count, 3),
        )


def _position(placement: Placement) -> Vector:
    return placement.x, placement.y, placement.z


def _along(placement: Placement) -> Vector:
    return placement.speed * math.cos(placement.yaw), placement.speed * math.sin(placement.yaw), 0.0
