"""Groups of entities: EntitySelections, wherever the standard lets a name of an entity stand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import product
from typing import Any, TypeVar

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.storyboard.context.condition import EntityCondition, Measure
from eidrive_scenario.storyboard.context.protocols import ConditionContext

E = TypeVar("E", bound=model.Element)

REFERENCES = ("entity_ref", "master_entity_ref", "trailer_ref")
"""Attributes that name an entity."""

EMPTY_MEMBER = ""
"""What stands in a list of entities for a group without members: an empty list would mean all entities."""

TYPES: Mapping[type[model.Element], str] = {
    model.Vehicle: "vehicle",
    model.Pedestrian: "pedestrian",
    model.MiscObject: "miscellaneous",
}
"""What a class is called where entities are selected by type; what another tool defines is `external`."""


class Selections:
    """The groups of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self._entities = scenario.entities
        self._external = scenario.external
        entities = scenario.document.entities
        declared = entities.entity_selection if entities is not None else ()
        self._groups = {one.name: one for one in declared if one.name not in scenario.entities}

    def members(self, name: str) -> list[str]:
        """The entity of this name, or the members of the group, each once. Raises ScenarioError for a circle."""
        return list(dict.fromkeys(self._members(name, ())))

    def alternatives(self, element: E) -> list[E]:
        """The element once for each way to put members in place of the groups that it names; itself if it names none.

        A list of entities (of a RelativeClearanceCondition) takes all members of a group.
        """
        element = self._with_lists(element)
        groups = sorted(self._named_in(element))
        choices = product(*(self.members(group) for group in groups))
        return [_renamed(element, dict(zip(groups, chosen, strict=True))) for chosen in choices]

    def single(self, element: E) -> E:
        """The element with a member in place of each group that it names. Raises ScenarioError unless there is one."""
        found = self.alternatives(element)
        if len(found) == 1:
            return found[0]
        group = sorted(self._named_in(element))[0]
        raise ScenarioError(
            Diagnostic(
                f"{type(element).__name__} names the selection {group!r} of {len(self.members(group))} entities",
                "one entity has to stand there",
                element.source,
                element.line,
            )
        )

    def _members(self, name: str, above: tuple[str, ...]) -> Iterator[str]:
        group = self._groups.get(name)
        if group is None:
            yield name
            return
        if name in above:
            told = f"the selection {name!r} is a member of itself"
            raise ScenarioError(Diagnostic(told, "take it out", group.source, group.line))
        for ref in group.members.entity_ref:
            yield from self._members(ref.entity_ref, (*above, name))
        for entry in group.members.by_type:
            yield from self._of_type(entry.object_type.value)

    def _of_type(self, kind: str) -> Iterator[str]:
        for name, entity in self._entities.items():
            if ("external" if name in self._external else TYPES[type(entity)]) == kind:
                yield name

    def _named_in(self, element: model.Element) -> set[str]:
        if not self._groups:
            return set()
        named = (getattr(below, name, None) for below in element.walk() for name in REFERENCES)
        return {name for name in named if isinstance(name, str) and name in self._groups}

    def _with_lists(self, element: E) -> E:
        """The element with groups in its own lists of entities replaced by their members; empty ones mean nobody."""
        if not self._groups:
            return element
        listed = getattr(element, "entity_ref", None)
        if not isinstance(listed, tuple):
            return element
        refs = [
            replace(ref, entity_ref=member)
            for ref in listed
            for member in self.members(ref.entity_ref) or [EMPTY_MEMBER]
        ]
        changes: dict[str, Any] = {"entity_ref": tuple(dict.fromkeys(refs))}
        return replace(element, **changes)


class AnyMemberCondition(EntityCondition):
    """A condition that names a group: it holds for an entity if it holds towards any member, one condition each."""

    def __init__(
        self, element: model.Element, entities: Sequence[str], rule: str, conditions: Sequence[EntityCondition]
    ) -> None:
        super().__init__(element, entities, rule)
        self.conditions = tuple(conditions)

    def bind(self, context: ConditionContext) -> None:
        """Bind them all."""
        for condition in self.conditions:
            condition.bind(context)

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Ask all, so that their histories stay whole."""
        return any([condition.holds_for(context, entity) for condition in self.conditions])

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """What is true of the first member towards which it holds, or of all."""
        holding = [condition for condition in self.conditions if condition.holds_for(context, entity)]
        told = [condition.explain_for(context, entity) for condition in holding[:1] or self.conditions]
        return " or ".join(told) or f"{entity}: {self.describe_for()}"

    def describe_for(self) -> str:
        """Each of them."""
        told = [condition.describe_for() for condition in self.conditions]
        return " or ".join(told) or f"{super().describe_for()} towards a selection without members"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Those of all."""
        return tuple(measure for condition in self.conditions for measure in condition.measures(context))


def _renamed(element: E, names: Mapping[str, str]) -> E:
    """A copy with entities by other names; the element itself where nothing changes."""
    if not names:
        return element
    changes: dict[str, Any] = {}
    for field in fields(element):
        value = getattr(element, field.name)
        if isinstance(value, model.Element):
            after: Any = _renamed(value, names)
        elif isinstance(value, tuple):
            after = tuple(_renamed(one, names) if isinstance(one, model.Element) else one for one in value)
        elif field.name in REFERENCES and value in names:
            after = names[value]
        else:
            continue
        if after != value:
            changes[field.name] = after
    return replace(element, **changes) if changes else element
