"""Background traffic of a run: the fleet, its generators, and the changes of each step."""

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
"""Maximum number of sites that are tested for a spawn."""
SPREAD, LEAST, MOST = 0.1, 0.8, 1.2
"""Standard deviation and bounds of the drivers' share of the speed limit. The distribution is that of passenger cars in
SUMO (`speedFactor` normc(1, 0.1, 0.2, 2)) with narrower bounds.
"""


@dataclass
class Changes:
    """Changes of the world by one step of the traffic.

    additions   entering actors with specification and placement
    removals    leaving actors
    placements  placements of all cars after the step
    """

    additions: dict[str, tuple[ActorSpec, Placement]] = field(default_factory=dict)
    removals: set[str] = field(default_factory=set)
    placements: dict[str, Placement] = field(default_factory=dict)


class BackgroundTraffic:
    """Background cars without storyboard entity: created by generators, driven by the fleet.

    Cars are named after their traffic, `<name>.0001` and so on. Each name is used once in a run.

    center     returns position and motion of an entity, or None while it is absent
    taken      names that are already in use
    must_stop  whether a traffic light requires a stop
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
        """Names of all cars."""
        return self.fleet.names

    def spec(self, name: str) -> ActorSpec:
        """Return the specification of a car."""
        return self.fleet.spec(name)

    def key(self, name: str) -> int:
        """Return the number of the next generator of this traffic name."""
        self._started[name] = self._started.get(name, 0) + 1
        return self._started[name]

    def start(self, instance: TrafficGenerator) -> None:
        """Start a generator. It takes effect from the next step on."""
        self.instances.append(instance)
        self._begun = True

    def stop(self, name: str | None) -> None:
        """Stop all generators of this name, or all generators. Their cars remain."""
        for instance in self.instances:
            if name is None or instance.name == name:
                instance.active = False

    def step(self, view: WorldView, dt: float) -> Changes:
        """Run the generators in each decision step, and move all cars by dt."""
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
        """Observe the other actors and run the generators."""
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
        """Return the sites on lanes at which cars are."""
        return SpawnSites.at(self.fleet.lanes, *self.fleet.places(names))

    def starting_speed(self, sites: SpawnSites, participant: Participant) -> Array:
        """Return the usual speeds of traffic at sites (K,) [m/s]."""
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
        """Spawn a participant at the first free site in random order. Return False if no site is free.

        speed        (K,) initial speed at each site [m/s]
        given_speed  initial speed that the scenario specifies, if any [m/s]
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
        """Remove a car."""
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
