"""Background traffic of a run: its population, its generators, and the changes of each step."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.traffic.spawning.generators import TrafficGenerator
from eidrive_scenario.traffic.spawning.population import Changes, Population
from eidrive_scenario.world.view import WorldView


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
        """Yield a warning for each generator whose road users were never complete so far, or had no suitable lane."""
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
        growing = any(instance.is_due(self.population) for instance in self.instances)
        self.fleet.observe(view, everywhere=growing)
        if growing:
            self.population.observe_foreign(view)
        for instance in self.instances:
            instance.step(self.population)
        self.instances = [instance for instance in self.instances if instance.active]
