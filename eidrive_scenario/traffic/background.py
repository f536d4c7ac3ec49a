"""All background traffic of a run: the fleet, the instances that make it, and what changes in each step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.lanes import FREE
from eidrive_scenario.traffic.spawning.bodies import WALKING, Participant
from eidrive_scenario.traffic.spawning.generators import CentralObject, TrafficGenerator
from eidrive_scenario.traffic.spawning.sites import SpawnAreas, SpawnSites, is_unoccupied
from eidrive_scenario.traffic.stop_lines import MustStop
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

TRIES = 24
"""So many places are looked at before it counts as none free."""
SPREAD, LEAST, MOST = 0.1, 0.8, 1.2
"""Standard deviation of the share of the limit to which drivers keep, and its bounds; those of SUMO's passenger cars
(`speedFactor` normc(1, 0.1, 0.2, 2)) with a narrower cut."""


@dataclass
class Changes:
    """What one step of the traffic asks of the world.

    additions  who enters, with body and place;  removals  who leaves;  placements  where all stand after the step
    """

    additions: dict[str, tuple[ActorSpec, Placement]] = field(default_factory=dict)
    removals: set[str] = field(default_factory=set)
    placements: dict[str, Placement] = field(default_factory=dict)


class BackgroundTraffic:
    """Cars that no storyboard element names: made by instances, driven by the fleet.

    Cars are called after their traffic, `<name>.0001` and on; no name is used twice in a run.

    center     where an entity is and moves, None while it is not in the world
    taken      names that nobody else may have
    must_stop  what the traffic lights say
    """

    def __init__(
        self,
        roads: RoadNetwork,
        *,
        seed: int,
        center: Callable[[str], CentralObject | None],
        taken: frozenset[str] = frozenset(),
        must_stop: MustStop | None = None,
    ) -> None:
        self.seed = seed
        self.fleet = Fleet(roads, seed=seed, must_stop=must_stop)
        self.ground = SpawnAreas(self.fleet.lanes)
        self.center = center
        self.time = 0.0
        self.dt = 0.0
        self.instances: list[TrafficGenerator] = []
        self._taken = taken
        self._counts: dict[str, int] = {}
        self._started: dict[str, int] = {}
        self._foreign = np.empty((0, 7))
        self._changes = Changes()
        self._begun = False

    @property
    def names(self) -> tuple[str, ...]:
        """All cars."""
        return self.fleet.names

    def spec(self, name: str) -> ActorSpec:
        """Return the body of a car."""
        return self.fleet.spec(name)

    def key(self, name: str) -> int:
        """Return the number of the next instance of this traffic."""
        self._started[name] = self._started.get(name, 0) + 1
        return self._started[name]

    def start(self, instance: TrafficGenerator) -> None:
        """An instance begins; it works from the next step on."""
        self.instances.append(instance)
        self._begun = True

    def stop(self, name: str | None) -> None:
        """End all instances of this name, or all: nothing comes and goes by them any more; their cars drive on."""
        for instance in self.instances:
            if name is None or instance.name == name:
                instance.active = False

    def step(self, view: WorldView, dt: float) -> Changes:
        """Let the instances bring in and take out cars as often as drivers decide, and all cars drive on by dt."""
        self.time, self.dt = view.time, self.fleet.interval(dt)
        changes = self._changes = Changes()
        if self.instances or len(self.fleet):
            if self._begun or self.fleet.decides:
                self._work(view)
            changes.placements = self.fleet.step(None, dt)
            for name in self.fleet.departed:
                self._forget(name)
        return changes

    def _work(self, view: WorldView) -> None:
        """Look where the others are; let the instances bring in and take out cars."""
        self._begun = False
        growing = any(instance.is_due(self) for instance in self.instances)
        self.fleet.observe(view, everywhere=growing)
        if growing:
            rows = [row for row, name in enumerate(view.names) if name not in self.fleet]
            self._foreign = view.boxes[rows]
        for instance in self.instances:
            instance.step(self)
        self.instances = [instance for instance in self.instances if instance.active]

    def positions(self, names: list[str]) -> tuple[Array, Array]:
        """Return x and y of cars [m]."""
        return self.fleet.positions(names)

    def sites(self, names: list[str]) -> SpawnSites:
        """Return the places on lanes where cars are."""
        return SpawnSites.at(self.fleet.lanes, *self.fleet.places(names))

    def starting_speed(self, sites: SpawnSites, participant: Participant) -> Array:
        """Return (K,) the speeds at which traffic usually passes places [m/s]."""
        if participant.walks:
            return np.full(len(sites), WALKING)
        lanes = self.fleet.lanes
        limit = lanes.limits(sites.row, sites.progress)
        limit = np.where(np.isfinite(limit), limit, FREE)
        bend = np.sqrt(participant.driver.lateral_acceleration / np.maximum(lanes.tightest(sites.row), 1e-6))
        return np.asarray(np.minimum(np.minimum(limit, bend), participant.spec.max_speed))

    def spawn(
        self,
        instance: TrafficGenerator,
        participant: Participant,
        sites: SpawnSites,
        speed: Array,
        rng: np.random.Generator,
        given_speed: float | None,
    ) -> bool:
        """Put a participant at the first free one of places in random order; False if none is free.

        speed  (K,) with which it would start at each;  given_speed  the one that the scenario states, if any
        """
        order = rng.permutation(len(sites))[:TRIES]
        some, speed = sites.subset(order), np.minimum(speed[order], participant.spec.max_speed)
        at = np.flatnonzero(is_unoccupied(self.fleet, some, participant, speed, self._foreign))
        if not at.size:
            return False
        n = int(at[0])
        name = self._new_name(instance.name)
        spec = replace(participant.spec, name=name)
        factor = float(np.clip(rng.normal(participant.speed_factor, SPREAD), LEAST, MOST))
        placement = self.fleet.add_at(
            spec,
            int(some.row[n]),
            float(some.progress[n]),
            speed=float(speed[n]),
            desired_speed=WALKING * factor if participant.walks else None,
            driver=participant.driver,
            factor=factor,
            fallback=FREE if given_speed is None else given_speed,
        )
        instance.members[name] = None
        self._changes.additions[name] = (spec, placement)
        return True

    def despawn(self, name: str) -> None:
        """A car disappears."""
        self.fleet.remove(name)
        self._forget(name)

    def _forget(self, name: str) -> None:
        for instance in self.instances:
            instance.members.pop(name, None)
        if self._changes.additions.pop(name, None) is None:
            self._changes.removals.add(name)

    def _new_name(self, traffic: str) -> str:
        while True:
            self._counts[traffic] = self._counts.get(traffic, 0) + 1
            name = f"{traffic}.{self._counts[traffic]:04d}"
            if name not in self._taken:
                return name
