"""A world without a physics engine, for tests of single actions and conditions."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.view import WorldView


class KinematicWorld:
    """A world without forces: everybody is exactly where the storyboard puts them."""

    def __init__(self, scenario: Scenario, dt: float) -> None:
        self.dt = dt
        self.tick = 0
        self.placements: dict[str, Placement] = {}
        self._entities = scenario.entities
        self._velocity: dict[str, tuple[float, float, float]] = {}
        self._acceleration: dict[str, tuple[float, float, float]] = {}

    def add(self, additions: Mapping[str, Placement]) -> None:
        for name, placement in additions.items():
            self.placements[name] = placement
            self._velocity[name] = _along(placement)
            self._acceleration[name] = (0.0, 0.0, 0.0)

    def remove(self, names: set[str]) -> None:
        for name in names:
            self.placements.pop(name, None)

    def move(self, placements: Mapping[str, Placement]) -> None:
        for name, after in placements.items():
            before = self.placements[name]
            velocity = tuple((b - a) / self.dt for a, b in zip(_position(before), _position(after), strict=True))
            if after.teleport or not after.across:
                velocity = _along(after)
            old = self._velocity[name]
            self._acceleration[name] = tuple((b - a) / self.dt for a, b in zip(old, velocity, strict=True))
            self._velocity[name] = velocity
            self.placements[name] = after
        self.tick += 1

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


def _position(placement: Placement) -> tuple[float, float, float]:
    return placement.x, placement.y, placement.z


def _along(placement: Placement) -> tuple[float, float, float]:
    return placement.speed * math.cos(placement.yaw), placement.speed * math.sin(placement.yaw), 0.0
