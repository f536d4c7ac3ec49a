"""Entity selections of a scenario and their members."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario.model import EntitySelection
from eidrive_scenario.openscenario.scenario import Scenario


class EntitySelections:
    """Entity selections of one scenario.

    declared  selections by name; an entity precedes a selection of the same name
    """

    def __init__(self, scenario: Scenario) -> None:
        self._entities_by_type = scenario.entities_by_type
        entities = scenario.document.entities
        declarations = entities.entity_selection if entities is not None else ()
        self.declared: Mapping[str, EntitySelection] = {
            one.name: one for one in declarations if one.name not in scenario.entities
        }

    def members(self, name: str) -> list[str]:
        """Return the entity of this name, or the members of the selection. Raise ScenarioError for a cycle."""
        return list(dict.fromkeys(self._members(name, ())))

    def _members(self, name: str, parents: tuple[str, ...]) -> Iterator[str]:
        group = self.declared.get(name)
        if group is None:
            yield name
            return
        if name in parents:
            text = f"selection {name!r} is a member of itself"
            raise ScenarioError(Diagnostic(text, "remove it from its members", group.source, group.line))
        for ref in group.members.entity_ref:
            yield from self._members(ref.entity_ref, (*parents, name))
        for entry in group.members.by_type:
            yield from self._entities_by_type.get(entry.object_type, ())
