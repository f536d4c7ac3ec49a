"""Population of background cars: the fleet, and the cars that enter and leave it in a step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.lanes import FREE
from eidrive_scenario.traffic.right_of_way import MustStop
from eidrive_scenario.traffic.spawning.bodies import WALKING, Participant
from eidrive_scenario.traffic.spawning.sites import (
    SpawnAreas,
    SpawnSites,
    comfortable_speeds,
    is_unoccupied,
    leaders_ahead,
)
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

TRIES = 24
"""Maximum number of sites that are tested for a spawn."""
SPREAD, LEAST, MOST = 0.1, 0.8, 1.2
"""Standard deviation and bounds of the drivers' share of the speed limit. The distribution is that of passenger cars in
SUMO (`speedFactor` normc(1, 0.1, 0.2, 2)) with narrower bounds.
"""


@dataclass(frozen=True)
class CentralObject:
    """Entity at the center of a swarm: position [m], heading [rad] and speed along it [m/s]."""

    x: float
    y: float
    heading: float
    speed: float


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


@dataclass
class CarGroup:
    """Cars of one generator.

    name     trafficName or its substitute, which prefixes the names of the cars
    members  cars that exist, in the order of creation
    """

    name: str
    members: dict[str, None] = field(default_factory=dict, init=False)


class Population:
    """Background cars of a run.

    Cars are named after their traffic, `<name>.0001` and so on. Each name is used once in a run.

    seed       seed of the run
    center     returns position and motion of an entity, or None while it is absent
    taken      names that are already in use
    must_stop  whether a traffic light requires a stop
    time, dt   current simulated time, and interval between decisions [s]
    ground     lanes, sidewalks and crossings on which participants may start
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
        self._taken = taken
        self._counts: dict[str, int] = {}
        self._groups: dict[str, CarGroup] = {}
        """Group of each car."""
        self._foreign = np.empty((0, 7))
        self._changes = Changes()

    def begin_step(self, view: WorldView, dt: float) -> Changes:
        """Start a step of dt [s] without changes. Return its changes, to which spawns and removals are added."""
        self.time, self.dt = view.time, self.fleet.interval(dt)
        self._changes = Changes()
        return self._changes

    def observe_foreign(self, view: WorldView) -> None:
        """Store the boxes of all actors outside the fleet, at which no car is spawned."""
        rows = [row for row, name in enumerate(view.names) if name not in self.fleet]
        self._foreign = view.boxes[rows]

    def starting_speed(self, sites: SpawnSites, participant: Participant) -> Array:
        """Return the usual speeds of traffic at sites (K,) [m/s]."""
        if participant.walks:
            return np.full(len(sites), WALKING)
        lanes = self.fleet.lanes
        limit = lanes.limits(sites.lane, sites.progress)
        limit = np.where(np.isfinite(limit), limit, FREE)
        bend = np.sqrt(participant.driver.lateral_acceleration / np.maximum(lanes.tightest(sites.lane), 1e-6))
        return np.asarray(np.minimum(np.minimum(limit, bend), participant.spec.max_speed))

    def spawn(
        self,
        group: CarGroup,
        participant: Participant,
        sites: SpawnSites,
        speed: Array,
        rng: np.random.Generator,
        given_speed: float | None,
    ) -> bool:
        """Spawn a participant at the first free site in random order. Return False if no site is free.

        speed        (K,) maximum initial speed at each site, reduced for leaders and junctions unless it is given [m/s]
        given_speed  initial speed that the scenario specifies, if any [m/s]
        """
        order = rng.permutation(len(sites))[:TRIES]
        some, speed = sites.subset(order), np.minimum(speed[order], participant.spec.max_speed)
        leaders = leaders_ahead(self.fleet, some, participant)
        if given_speed is None:
            speed = np.minimum(speed, comfortable_speeds(self.fleet.lanes, some, participant, leaders))
        at = np.flatnonzero(is_unoccupied(self.fleet, some, participant, speed, leaders, self._foreign))
        if not at.size:
            return False
        n = int(at[0])
        name = self._new_name(group.name)
        spec = replace(participant.spec, name=name)
        factor = float(np.clip(rng.normal(participant.speed_factor, SPREAD), LEAST, MOST))
        # Without such drivers nothing is drawn, so that all other draws of the attempt remain the same.
        ignores = participant.ignore_lights > 0.0 and bool(rng.uniform() < participant.ignore_lights)
        placement = self.fleet.add_at(
            spec,
            int(some.lane[n]),
            float(some.progress[n]),
            speed=float(speed[n]),
            desired_speed=WALKING * factor if participant.walks else None,
            driver=participant.driver,
            factor=factor,
            fallback=given_speed or FREE,
            ignores_lights=ignores,
        )
        group.members[name] = None
        self._groups[name] = group
        self._changes.additions[name] = (spec, placement)
        return True

    def despawn(self, name: str) -> None:
        """Remove a car."""
        self.fleet.remove(name)
        self.forget(name)

    def forget(self, name: str) -> None:
        """Remove a car that has left the fleet from its group and from the world."""
        group = self._groups.pop(name, None)
        if group is not None:
            group.members.pop(name, None)
        if self._changes.additions.pop(name, None) is None:
            self._changes.removals.add(name)

    def _new_name(self, traffic: str) -> str:
        while True:
            self._counts[traffic] = self._counts.get(traffic, 0) + 1
            name = f"{traffic}.{self._counts[traffic]:04d}"
            if name not in self._taken:
                return name
