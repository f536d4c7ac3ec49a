"""Sinks: positions at which background traffic disappears."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.traffic.spawning.generators import TrafficGenerator
from eidrive_scenario.traffic.spawning.population import Population


@dataclass
class Sink(TrafficGenerator):
    """Sink that removes background cars within a radius [m] around a position at a maximum rate [1/s].

    categories  categories of the removed cars, None for all
    """

    place: tuple[float, float]
    radius: float
    rate: float
    categories: frozenset[str] | None
    _next: float = field(default=-math.inf, init=False)

    def is_due(self, population: Population) -> bool:
        """Return False, as a sink never spawns cars."""
        return False

    def step(self, population: Population) -> None:
        """Remove the nearest cars within the radius as far as the rate permits."""
        if self.rate <= 0.0:
            return
        names = [name for name in population.fleet.names if self._takes(population, name)]
        if not names:
            return
        x, y = population.fleet.positions(names)
        distance = np.hypot(x - self.place[0], y - self.place[1])
        for n in np.argsort(distance, kind="stable").tolist():
            if distance[n] > self.radius or self._next > population.time + TIME_TOLERANCE:
                return
            population.despawn(names[n])
            # Unused capacity is not accumulated.
            self._next = max(self._next, population.time - population.dt) + 1.0 / self.rate

    def _takes(self, population: Population, name: str) -> bool:
        return self.categories is None or population.fleet.spec(name).category in self.categories
