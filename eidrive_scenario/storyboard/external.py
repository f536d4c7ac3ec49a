"""Entities that are defined outside of the scenario: ExternalObjectReferences, found in the road network where it can.

One that has the id or name of an object of the road network has that object's size, and stands where it stands unless
the scenario puts it somewhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import PlacedObject, RoadNetwork, placed_objects
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.specs import actor_spec


class ExternalObjects:
    """The entities of one scenario that are defined elsewhere."""

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None) -> None:
        self._scenario = scenario
        self._found: Mapping[str, PlacedObject | None] = {
            name: _find(reference.name, roads) for name, reference in scenario.external.items()
        }
        self.warnings = tuple(
            Diagnostic(
                f"entity {name!r} refers to the external object {scenario.external[name].name!r}, "
                "of which nothing is known here: a box of half a meter stands for it",
                "give it a Vehicle, Pedestrian or MiscObject",
                scenario.external[name].source,
                scenario.external[name].line,
            )
            for name, found in self._found.items()
            if found is None
        )

    def places(self) -> Mapping[str, PlacedObject]:
        """Those that the road network has, and how they stand there."""
        return {name: found for name, found in self._found.items() if found is not None}

    def body(self, name: str) -> ActorSpec | None:
        """The body of one that the road network has; None for all others."""
        found = self._found.get(name)
        if found is None:
            return None
        usual = actor_spec(name, self._scenario.entities[name])
        size = (found.length or usual.size[0], found.width or usual.size[1], found.height or usual.size[2])
        return replace(usual, size=size, offset=(0.0, 0.0, size[2] / 2.0))


def _find(name: str, roads: RoadNetwork | None) -> PlacedObject | None:
    if roads is None:
        return None
    placed = list(placed_objects(roads)) if name else []
    return next((one for key in ("id", "name") for one in placed if getattr(one.object, key) == name), None)
