"""External objects: entities that are defined outside of the scenario by an ExternalObjectReference.

A reference with the id or name of an object of the road network has the size of that object, and its pose unless the
scenario places the entity elsewhere.
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
    """External objects of one scenario."""

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None) -> None:
        self._scenario = scenario
        self._objects: Mapping[str, PlacedObject | None] = {
            name: _find(reference.name, roads) for name, reference in scenario.external.items()
        }
        self.warnings = tuple(
            Diagnostic(
                f"entity {name!r} is represented by a box of 0.5 m: the external object "
                f"{scenario.external[name].name!r} is unknown",
                "define a Vehicle, Pedestrian or MiscObject",
                scenario.external[name].source,
                scenario.external[name].line,
            )
            for name, found in self._objects.items()
            if found is None
        )

    def in_road_network(self) -> Mapping[str, PlacedObject]:
        """Return the external objects that are objects of the road network, by entity."""
        return {name: found for name, found in self._objects.items() if found is not None}

    def body(self, name: str) -> ActorSpec | None:
        """Return the body of an entity that is an object of the road network; None for other entities."""
        found = self._objects.get(name)
        if found is None:
            return None
        default = actor_spec(name, self._scenario.entities[name])
        size = (found.length or default.size[0], found.width or default.size[1], found.height or default.size[2])
        return replace(default, size=size, offset=(0.0, 0.0, size[2] / 2.0))


def _find(name: str, roads: RoadNetwork | None) -> PlacedObject | None:
    if roads is None:
        return None
    placed = list(placed_objects(roads)) if name else []
    return next((one for key in ("id", "name") for one in placed if getattr(one.object, key) == name), None)
