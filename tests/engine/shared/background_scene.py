"""A street with a moving entity and background traffic, stepped without a world."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from fleet_scene import car, street, view_of
from msgspec.structs import replace

from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.traffic import (
    BackgroundTraffic,
    Changes,
    Participant,
    Population,
    Swarm,
)
from eidrive_scenario.traffic.spawning.bodies import TrafficMix
from eidrive_scenario.traffic.spawning.generators import TrafficGenerator
from eidrive_scenario.traffic.spawning.population import CentralObject
from eidrive_scenario.world.actor import ActorSpec, Placement

DT = 0.1
"""Step of the background traffic [s]."""


class Cars(TrafficMix):
    """Mix with one kind of car."""

    def __init__(self, spec: ActorSpec) -> None:
        self._spec = spec

    def draw(self, rng: np.random.Generator) -> Participant:
        return Participant(self._spec, IntelligentDriver())

    @property
    def categories(self) -> frozenset[str]:
        return frozenset((self._spec.category,))


class Scene:
    """Street of 4 km with the entity Ego, which moves at 10 m/s, and background traffic."""

    def __init__(self, left: int = 2, right: int = 2, *, seed: int = 1, length: float = 4000.0) -> None:
        self.ego = Placement(1000.0, -1.75, speed=10.0)
        self.tick = 0
        population = Population(
            street(left, right, length=length),
            seed=seed,
            center=lambda name: (
                CentralObject(self.ego.x, self.ego.y, self.ego.yaw, self.ego.speed) if name == "Ego" else None
            ),
            taken=frozenset({"swarm.0003"}),
        )
        self.traffic = BackgroundTraffic(population)
        self.placements: dict[str, Placement] = {}

    @property
    def mixture(self) -> TrafficMix:
        return Cars(car("car"))

    def start(self, instance: TrafficGenerator) -> None:
        self.traffic.start(instance)

    def run(self, seconds: float) -> Iterator[Changes]:
        for _ in range(round(seconds / DT)):
            view = view_of({"Ego": self.ego} | self.placements, self.tick * DT, self.tick)
            self.before = view
            changes = self.traffic.step(view, DT)
            yield changes
            self.placements = dict(changes.placements)
            self.tick += 1
            self.ego = replace(self.ego, x=self.ego.x + self.ego.speed * DT)


def swarm(scene: Scene, **given: object) -> Swarm:
    """Start a swarm of 30 cars around Ego with further settings."""
    settings: dict[str, object] = {
        "center": "Ego",
        "inner": 50.0,
        "major": 300.0,
        "minor": 100.0,
        "offset": 20.0,
        "count": 30,
        "mixture": scene.mixture,
    }
    instance = Swarm("swarm", scene.traffic.key("swarm"), **(settings | given))  # type: ignore[arg-type]
    scene.start(instance)
    return instance
