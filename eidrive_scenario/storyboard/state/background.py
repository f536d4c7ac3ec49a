"""The stage's side of background traffic: cars that no element of the storyboard names."""

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
    """Background traffic of one run; without an instance there is none, and it costs nothing.

    center     where an entity is and moves, None while it is not in the world
    taken      names that no car may have
    must_stop  whether the traffic light of an id tells traffic to stop
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
        """The traffic itself; only where there are roads."""
        assert self._roads is not None
        self._started = True
        return BackgroundTraffic(
            self._roads, seed=self._seed, center=self._center, taken=self._taken, must_stop=self._must_stop
        )

    @property
    def names(self) -> tuple[str, ...]:
        """All cars that are there."""
        return self.traffic.names if self._started else ()

    def start(self, instance: TrafficGenerator) -> None:
        """An instance begins: its first cars enter in this tick, or in the first one where it begins in Init."""
        self.traffic.start(instance)

    def stop(self, name: str | None) -> None:
        """End all instances of this name, or all of them."""
        if self._started:
            self.traffic.stop(name)

    def step(self, view: WorldView, dt: float, commands: Commands) -> None:
        """Add to the commands what the traffic does in the step that begins with this view."""
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
