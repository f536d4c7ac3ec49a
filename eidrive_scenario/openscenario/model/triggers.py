"""Triggers: conditions joined by and within a group, by or between groups."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import Choice
from eidrive_scenario.openscenario.model.element import Element
from eidrive_scenario.openscenario.model.entity_conditions import ByEntityCondition
from eidrive_scenario.openscenario.model.enumerations import ConditionEdge
from eidrive_scenario.openscenario.model.value_conditions import ByValueCondition


@dataclass(frozen=True, kw_only=True)
class Condition(Element, content=Choice(empty_until="1.2")):
    """A condition, its edge, and how long ago it has to have held [s]."""

    condition_edge: ConditionEdge
    delay: float
    name: str
    by_entity_condition: ByEntityCondition | None = None
    by_value_condition: ByValueCondition | None = None


@dataclass(frozen=True, kw_only=True)
class ConditionGroup(Element):
    """Conditions that have to hold together."""

    condition: tuple[Condition, ...]


@dataclass(frozen=True, kw_only=True)
class Trigger(Element):
    """Fires when one of its groups holds; one without groups never fires."""

    condition_group: tuple[ConditionGroup, ...] = ()
