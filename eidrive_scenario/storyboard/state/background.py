"""Port of the storyboard to background traffic: vehicles that are no entities of the scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from msgspec.structs import replace

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.world.view import WorldView

if TYPE_CHECKING:
    from eidrive_scenario.traffic.background import BackgroundTraffic
    from eidrive_scenario.traffic.spawning.generators import TrafficGenerator


class BackgroundTrafficPort:
    """Background traffic of one run. `build` builds it for its first instance."""

    def __init__(self, build: Callable[[], BackgroundTraffic]) -> None:
        self._build = build
        self._traffic: BackgroundTraffic | None = None

    @property
    def traffic(self) -> BackgroundTraffic:
        """Background traffic of the run; requires a road network."""
        if self._traffic is None:
            self._traffic = self._build()
        return self._traffic

    @property
    def started(self) -> bool:
        """Whether the background traffic exists."""
        return self._traffic is not None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all vehicles of background traffic."""
        return () if self._traffic is None else self._traffic.names

    def start(self, instance: TrafficGenerator) -> None:
        """Start an instance. Its first vehicles enter in this tick; in the first tick if it starts in Init."""
        self.traffic.start(instance)

    def stop(self, name: str | None) -> None:
        """Stop all instances of this name; all instances without a name."""
        if self._traffic is not None:
            self._traffic.stop(name)

    def shortages(self) -> Iterator[Diagnostic]:
        """Yield a warning for each instance whose road users were never complete so far."""
        if self._traffic is not None:
            yield from self._traffic.shortages()

    def step(self, view: WorldView, dt: float, commands: Commands) -> None:
        """Add spawns, removals and placements of the step that begins with this view to the commands."""
        changes = self.traffic.step(view, dt)
        for name, (spec, placement) in changes.additions.items():
            commands.spawns[name] = placement
            commands.actor_specs[name] = spec
        commands.removals |= changes.removals
        commands.placements.update(changes.placements)
        for name in changes.additions:
            if name not in changes.placements:
                commands.placements[name] = replace(commands.spawns[name], teleport=True)
