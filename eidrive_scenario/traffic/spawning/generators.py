"""Generators of background traffic (swarms, sources, areas), sinks at which it disappears, and all traffic of a run."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import compress

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import Diagnostic, counted, quoted
from eidrive_scenario.openscenario.model import Element
from eidrive_scenario.traffic.spawning.bodies import Participant, TrafficMix, WeightedChoice
from eidrive_scenario.traffic.spawning.population import CarGroup, CentralObject, Changes, Population
from eidrive_scenario.traffic.spawning.sites import Covers, SpawnSites, is_wide_enough
from eidrive_scenario.world.view import WorldView

RETRY = 0.5
"""Delay of the next attempt if no site was free [s]."""
ATTEMPTS = 5
"""Maximum number of failed attempts to spawn a car in one step."""
ON_RATE = 0.9
"""Share of the rate of a source below which it is a shortage."""
RIM = 0.8
"""Share of the axes of the ellipse from which on a swarm is replenished."""


@dataclass
class TrafficGenerator(CarGroup, ABC):
    """Traffic of one name, from the start of its action until it is stopped.

    key      distinguishes generators of the same name
    element  action of the scenario, for messages
    """

    key: int
    element: Element | None = field(default=None, init=False)
    active: bool = field(default=True, init=False)
    _draws: int = field(default=0, init=False)

    @abstractmethod
    def step(self, population: Population) -> None:
        """Spawn and despawn cars in this step."""

    def is_due(self, population: Population) -> bool:
        """Return whether a car may be spawned now; never by a sink."""
        return False

    @property
    def shortage(self) -> Diagnostic | None:
        """Warning that road users are missing; None if they were complete, and before the first attempt."""
        return None

    def _warning(self, message: str, hint: str) -> Diagnostic:
        element = self.element
        source, line = ("", None) if element is None else (element.source, element.line)
        return Diagnostic(f"traffic {quoted(self.name)}: {message}", hint, source, line)

    def rng(self, population: Population) -> np.random.Generator:
        """Return the random generator of the next attempt to spawn a car."""
        self._draws += 1
        return generator(population.seed, "traffic", self.name, self.key, self._draws)


@dataclass
class MaintainedTraffic(TrafficGenerator):
    """Base class of traffic whose number of participants is maintained.

    count  number of participants
    """

    count: int
    mixture: TrafficMix
    _again: float = field(default=0.0, init=False)
    _most: int | None = field(default=None, init=False)
    """Maximum number of participants at one time; None before the first attempt."""

    def is_due(self, population: Population) -> bool:
        """Return whether participants are missing."""
        return len(self.members) < self.count and population.time >= self._again - TIME_TOLERANCE

    def fill(self, population: Population, spawn_one: Callable[[], bool], attempts: int = ATTEMPTS) -> None:
        """Spawn missing participants by `spawn_one` until so many attempts have failed; then wait."""
        failures = 0
        while self.is_due(population) and failures < attempts:
            failures += not spawn_one()
        if failures:
            self._again = population.time + RETRY
        self._most = max(self._most or 0, len(self.members))

    @property
    def shortage(self) -> Diagnostic | None:
        """Warning that the participants were never complete; None if they were, and before the first attempt."""
        if self._most is None or self._most >= self.count:
            return None
        message = f"at most {self._most} of {counted(self.count, 'road user')} found a free place"
        return self._warning(message, "enlarge the area, or reduce the number")


@dataclass
class Swarm(MaintainedTraffic):
    """Traffic between a circle around an entity and an ellipse, whose center is `offset` [m] ahead along its x axis.

    The whole ring is filled once. Cars outside the ellipse are removed and replaced near its edge, at sites from which
    they drive inwards relative to the entity.

    speeds      range of the initial speeds [m/s], None for the speed limit
    directions  weights of the same and the opposite direction of travel relative to the entity, None for any
    sectors     weights of the sectors front, rear, left and right of the entity, None for any
    """

    center: str
    inner: float
    major: float
    minor: float
    offset: float
    speeds: tuple[float, float] | None = None
    directions: tuple[float, float] | None = None
    sectors: tuple[float, float, float, float] | None = None
    _filled: bool = field(default=False, init=False)

    @property
    def shortage(self) -> Diagnostic | None:
        """Warning that no car found a site: `numberOfVehicles` is a maximum (ASAM OpenSCENARIO XML 1.3.1)."""
        return None if self._most else super().shortage

    def step(self, population: Population) -> None:
        """Remove cars outside the ellipse and spawn missing ones."""
        center = population.center(self.center)
        if center is None:
            return
        if self.members:
            names = list(self.members)
            x, y = population.fleet.positions(names)
            for name in compress(names, self._shares(center, x, y) > 1.0):
                population.despawn(name)
        self.fill(population, partial(self._spawn_one, population, center), 1 if self._filled else ATTEMPTS)
        self._filled = True

    def _shares(self, center: CentralObject, x: Array, y: Array) -> Array:
        """Return the shares of the axes of the ellipse."""
        cos, sin = math.cos(center.heading), math.sin(center.heading)
        dx, dy = x - center.x - self.offset * cos, y - center.y - self.offset * sin
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        return np.hypot(ahead / max(self.major, 1e-9), left / max(self.minor, 1e-9))

    def _spawn_one(self, population: Population, center: CentralObject) -> bool:
        rng = self.rng(population)
        participant = self.mixture.draw(rng)
        sites = population.ground.for_body(participant)
        share = self._shares(center, sites.x, sites.y)
        fit = (np.hypot(sites.x - center.x, sites.y - center.y) >= self.inner) & (share <= 1.0)
        fit &= self._direction(rng, center, sites) & self._sector(rng, center, sites)
        speed = population.starting_speed(sites, participant)
        if self.speeds is not None:
            speed = np.full(len(sites), rng.uniform(*self.speeds))
        choices = [fit]
        if self._filled:
            vx = speed * np.cos(sites.heading) - center.speed * math.cos(center.heading)
            vy = speed * np.sin(sites.heading) - center.speed * math.sin(center.heading)
            inwards = (sites.x - center.x) * vx + (sites.y - center.y) * vy < 0.0
            rim = fit & (share >= RIM)
            choices = [rim & inwards, rim, fit]
        given = None if self.speeds is None else float(speed[0]) if len(speed) else None
        return any(
            population.spawn(self, participant, sites.subset(choice), speed[choice], rng, given)
            for choice in choices
            if choice.any()
        )

    def _direction(self, rng: np.random.Generator, center: CentralObject, sites: SpawnSites) -> Bools:
        if self.directions is None:
            return np.ones(len(sites), dtype=bool)
        same: Bools = np.cos(sites.heading - center.heading) >= 0.0
        return WeightedChoice((same, ~same), self.directions).draw(rng)

    def _sector(self, rng: np.random.Generator, center: CentralObject, sites: SpawnSites) -> Bools:
        """Select one of the four sectors of 90° around the entity."""
        if self.sectors is None:
            return np.ones(len(sites), dtype=bool)
        bearing = np.arctan2(sites.y - center.y, sites.x - center.x) - center.heading
        quarter = np.round(bearing / (math.pi / 2)).astype(np.int64) % 4
        front, rear, left, right = self.sectors
        return np.asarray(quarter == WeightedChoice(range(4), (front, left, rear, right)).draw(rng))


@dataclass
class Source(TrafficGenerator):
    """Source of cars at a constant rate [1/s] at sites around a position. If none is free, the next car waits.

    A participant without a suitable lane, such as a pedestrian without a sidewalk, is replaced by another draw.

    speed  initial speed [m/s], None for the speed limit
    """

    sites: Callable[[Participant], SpawnSites]
    rate: float
    mixture: TrafficMix
    speed: float | None
    started: float
    _made: int = field(default=0, init=False)
    _elapsed: float = field(default=0.0, init=False)
    """Time from the start to the last step [s]."""
    _waiting: Participant | None = field(default=None, init=False)
    _without_lane: set[str] = field(default_factory=set, init=False)
    """Categories of participants without a suitable lane."""

    def is_due(self, population: Population) -> bool:
        """Return whether the next car is due."""
        return self.rate > 0.0 and population.time - self.started >= self._made / self.rate - TIME_TOLERANCE

    def step(self, population: Population) -> None:
        """Spawn cars that are due. A car without a free site is retried."""
        self._elapsed = population.time - self.started
        while self.is_due(population):
            rng = self.rng(population)
            participant = self._waiting or self.mixture.draw(rng)
            sites = self.sites(participant)
            if not np.any(is_wide_enough(sites, participant)):
                self._without_lane.add(participant.spec.category)
                return
            speed = population.starting_speed(sites, participant)
            if self.speed is not None:
                speed = np.full(len(sites), self.speed)
            if not population.spawn(self, participant, sites, speed, rng, self.speed):
                self._waiting = participant
                return
            self._waiting = None
            self._made += 1

    @property
    def shortage(self) -> Diagnostic | None:
        """Warning that participants had no suitable lane, or were fewer than the rate gives.

        A car may wait at the end, so that one less than those that were due is enough.
        """
        if self._without_lane:
            missing = ", ".join(sorted(self._without_lane))
            return self._warning(f"no lane at the source is suitable for: {missing}", "remove them, or move the source")
        if self._made >= ON_RATE * math.floor(self._elapsed * self.rate):
            return None
        message = f"{self._made / self._elapsed:.2g} road users per second entered (expected {self.rate:g})"
        return self._warning(message, "reduce the rate, or enlarge the radius")


@dataclass
class Area(MaintainedTraffic):
    """Number of participants in an area: spawned once, or maintained.

    covers  whether sites are inside the area
    """

    continuous: bool
    covers: Covers
    _inside: dict[bool, SpawnSites] = field(default_factory=dict, init=False)
    """Sites inside the area for vehicles and for pedestrians."""

    def step(self, population: Population) -> None:
        """Remove participants outside the area and spawn missing ones. Finish if the area is not continuous."""
        if self.members:
            names = list(self.members)
            fleet = population.fleet
            for name in compress(names, ~self.covers(SpawnSites.at(fleet.lanes, *fleet.places(names)))):
                population.despawn(name)
        self.fill(population, partial(self._spawn_one, population))
        if not self.continuous:
            self.active = False

    def _spawn_one(self, population: Population) -> bool:
        rng = self.rng(population)
        participant = self.mixture.draw(rng)
        if participant.walks not in self._inside:
            self._inside[participant.walks] = population.ground.covered(participant, self.covers)
        sites = self._inside[participant.walks]
        speed = population.starting_speed(sites, participant)
        return len(sites) > 0 and population.spawn(self, participant, sites, speed, rng, None)


@dataclass
class Sink(TrafficGenerator):
    """Sink that removes background cars within a radius [m] around a position at a maximum rate [1/s].

    categories  categories of the removed cars, None for all
    """

    position: tuple[float, float]
    radius: float
    rate: float
    categories: frozenset[str] | None
    _next: float = field(default=-math.inf, init=False)

    def step(self, population: Population) -> None:
        """Remove the nearest cars within the radius as far as the rate permits."""
        if self.rate <= 0.0:
            return
        fleet, taken = population.fleet, self.categories
        names = [name for name in fleet.names if taken is None or fleet.spec(name).category in taken]
        if not names:
            return
        x, y = fleet.positions(names)
        distance = np.hypot(x - self.position[0], y - self.position[1])
        for n in np.argsort(distance, kind="stable").tolist():
            if distance[n] > self.radius or self._next > population.time + TIME_TOLERANCE:
                return
            population.despawn(names[n])
            # Unused capacity is not accumulated.
            self._next = max(self._next, population.time - population.dt) + 1.0 / self.rate


class BackgroundTraffic:
    """Background cars without storyboard entity: created by generators, driven by the fleet."""

    def __init__(self, population: Population) -> None:
        self.population = population
        self.fleet = population.fleet
        self.instances: list[TrafficGenerator] = []
        self._generators: list[TrafficGenerator] = []
        """All generators, also those that have stopped."""
        self._started: dict[str, int] = {}
        self._begun = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all cars."""
        return self.fleet.names

    def key(self, name: str) -> int:
        """Return the number of the next generator of this traffic name."""
        self._started[name] = self._started.get(name, 0) + 1
        return self._started[name]

    def start(self, instance: TrafficGenerator) -> None:
        """Start a generator. It takes effect from the next step on."""
        self.instances.append(instance)
        self._generators.append(instance)
        self._begun = True

    def stop(self, name: str | None) -> None:
        """Stop all generators of this name, or all generators. Their cars remain."""
        for instance in self.instances:
            if name is None or instance.name == name:
                instance.active = False

    def shortages(self) -> Iterator[Diagnostic]:
        """Yield a warning for each generator whose road users were fewer than requested, or had no suitable lane."""
        for instance in self._generators:
            if (shortage := instance.shortage) is not None:
                yield shortage

    def step(self, view: WorldView, dt: float) -> Changes:
        """Run the generators in each decision step, and move all cars by dt."""
        changes = self.population.begin_step(view, dt)
        if self.instances or len(self.fleet):
            if self._begun or self.fleet.decides:
                self._run_generators(view)
            changes.placements = self.fleet.step(None, dt)
            for name in self.fleet.departed:
                self.population.forget(name)
        return changes

    def _run_generators(self, view: WorldView) -> None:
        """Observe the other actors and run the generators."""
        self._begun = False
        self.instances = [instance for instance in self.instances if instance.active]
        growing = any(instance.is_due(self.population) for instance in self.instances)
        self.fleet.observe(view, everywhere=growing)
        if growing:
            self.population.observe_foreign(view)
        for instance in self.instances:
            instance.step(self.population)
