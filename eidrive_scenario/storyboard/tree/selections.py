"""Entity selections, which may replace the name of an entity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from itertools import product
from typing import Any, TypeVar

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.storyboard.context.condition import EntityCondition, Measure
from eidrive_scenario.storyboard.context.contexts import ConditionContext

E = TypeVar("E", bound=model.Element)

REFERENCES = ("entity_ref", "master_entity_ref", "trailer_ref")
"""Attributes that refer to an entity."""

EMPTY_MEMBER = ""
"""Entry of a list of entities for a selection without members, as an empty list refers to all entities."""


class Selections(EntitySelections):
    """Entity selections of one scenario, and their substitution in elements."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._single: dict[int, tuple[model.Element, Any]] = {}
        """Elements and the results of `single`, by `id` of the element."""

    def alternatives(self, element: E) -> list[E]:
        """Return the element once per combination of members of the selections that it refers to.

        A list of entities (of a RelativeClearanceCondition) contains all members of a selection.
        """
        element = self._with_expanded_lists(element)
        groups = sorted(self._named_groups(element))
        choices = product(*(self.members(group) for group in groups))
        return [_with_names(element, dict(zip(groups, chosen, strict=True))) for chosen in choices]

    def single(self, element: E) -> E:
        """Return the element with the member of each selection. Raise ScenarioError unless each has one member.

        An element has one result, by which the behaviours of an action are recognized.
        """
        alternatives = self.alternatives(element)
        if len(alternatives) == 1:
            result: E = self._single.setdefault(id(element), (element, alternatives[0]))[1]
            return result
        group = min(self._named_groups(element))
        hint = f"got a selection of {len(self.members(group))} entities; expected one entity"
        raise ScenarioError(Diagnostic.at(element, f"{type(element).__name__} refers to selection {group!r}", hint))

    def _named_groups(self, element: model.Element) -> set[str]:
        if not self.declared:
            return set()
        named = (getattr(child, name, None) for child in element.walk() for name in REFERENCES)
        return {name for name in named if isinstance(name, str) and name in self.declared}

    def _with_expanded_lists(self, element: E) -> E:
        """Return the element with selections in its lists of entities replaced by their members."""
        references = getattr(element, "entity_ref", None)
        if not self.declared or not isinstance(references, tuple):
            return element
        refs = [
            replace(ref, entity_ref=member)
            for ref in references
            for member in self.members(ref.entity_ref) or [EMPTY_MEMBER]
        ]
        changes: dict[str, Any] = {"entity_ref": tuple(dict.fromkeys(refs))}
        return replace(element, **changes)


class AnyMemberCondition(EntityCondition):
    """Condition that refers to a selection: it is fulfilled if it is fulfilled for any member."""

    def __init__(
        self, element: model.Element, entities: Sequence[str], rule: str, conditions: Sequence[EntityCondition]
    ) -> None:
        super().__init__(element, entities, rule)
        self.conditions = tuple(conditions)

    def bind(self, context: ConditionContext) -> None:
        """Bind the conditions of all members."""
        for condition in self.conditions:
            condition.bind(context)

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Whether it is fulfilled for any member. All are evaluated, so that their histories are complete."""
        return any([condition.holds_for(context, entity) for condition in self.conditions])

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the values for the first member that fulfills it; without one, for all members."""
        fulfilled = [condition for condition in self.conditions if condition.holds_for(context, entity)]
        text = [condition.explain_for(context, entity) for condition in fulfilled[:1] or self.conditions]
        return " or ".join(text) or f"{entity}: {self.describe_for()}"

    def describe_for(self) -> str:
        """Describe the conditions of all members."""
        text = [condition.describe_for() for condition in self.conditions]
        return " or ".join(text) or f"{super().describe_for()} for a selection without members"

    def measures(self, context: ConditionContext) -> tuple[Measure, ...]:
        """Return the quantities of all members."""
        return tuple(measure for condition in self.conditions for measure in condition.measures(context))


def _with_names(element: E, names: Mapping[str, str]) -> E:
    """Return a copy with other names of entities; the element itself without a change."""
    if not names:
        return element
    changes: dict[str, Any] = {}
    for field in fields(element):
        value = getattr(element, field.name)
        if isinstance(value, model.Element):
            changed: Any = _with_names(value, names)
        elif isinstance(value, tuple):
            changed = tuple(_with_names(item, names) if isinstance(item, model.Element) else item for item in value)
        elif field.name in REFERENCES and value in names:
            changed = names[value]
        else:
            continue
        if changed != value:
            changes[field.name] = changed
    return replace(element, **changes) if changes else element
