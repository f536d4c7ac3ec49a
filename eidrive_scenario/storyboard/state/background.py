"""Port of the storyboard to background traffic: vehicles that are no entities of the scenario."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.traffic.background import BackgroundTraffic
from eidrive_scenario.traffic.spawning.generators import CentralObject, TrafficGenerator
from eidrive_scenario.world.view import WorldView


class BackgroundTrafficPort:
    """Background traffic of one run. It is created with its first instance.

    center     returns pose and speed of an entity, None while it is absent
    taken      names that no vehicle may have
    must_stop  returns whether the state of a traffic signal, by id, requires vehicles to stop
    """

    def __init__(
        self,
        roads: RoadNetwork | None,
        *,
        seed: int,
        center: Callable[[str], CentralObject | None],
        taken: frozenset[str],
        must_stop: Callable[[str], bool],
    ) -> None:
        self._roads = roads
        self._seed = seed
        self._center = center
        self._taken = taken
        self._must_stop = must_stop
        self._started = False

    @cached_property
    def traffic(self) -> BackgroundTraffic:
        """Background traffic of the run; requires a road network."""
        assert self._roads is not None
        self._started = True
        return BackgroundTraffic(
            self._roads, seed=self._seed, center=self._center, taken=self._taken, must_stop=self._must_stop
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all vehicles of background traffic."""
        return self.traffic.names if self._started else ()

    def start(self, instance: TrafficGenerator) -> None:
        """Start an instance. Its first vehicles enter in this tick; in the first tick if it starts in Init."""
        self.traffic.start(instance)

    def stop(self, name: str | None) -> None:
        """Stop all instances of this name; all instances without a name."""
        if self._started:
            self.traffic.stop(name)

    def step(self, view: WorldView, dt: float, commands: Commands) -> None:
        """Add spawns, removals and placements of the step that begins with this view to the commands."""
        if not self._started:
            return
        changes = self.traffic.step(view, dt)
        for name, (spec, placement) in changes.additions.items():
            commands.spawns[name] = placement
            commands.actor_specs[name] = spec
        commands.removals |= changes.removals
        commands.placements.update(changes.placements)
        for name in changes.additions:
            if name not in changes.placements:
                commands.placements[name] = replace(commands.spawns[name], teleport=True)
