"""Triggers: conditions are combined by AND within a group, and groups by OR."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import Choice
from eidrive_scenario.openscenario.model.element import Element
from eidrive_scenario.openscenario.model.entity_conditions import ByEntityCondition
from eidrive_scenario.openscenario.model.enumerations import ConditionEdge
from eidrive_scenario.openscenario.model.value_conditions import ByValueCondition


@dataclass(frozen=True, kw_only=True)
class Condition(Element, content=Choice(empty_until="1.2")):
    """Condition with its edge and delay [s]."""

    condition_edge: ConditionEdge
    delay: float
    name: str
    by_entity_condition: ByEntityCondition | None = None
    by_value_condition: ByValueCondition | None = None


@dataclass(frozen=True, kw_only=True)
class ConditionGroup(Element):
    """Conditions that must hold at the same time."""

    condition: tuple[Condition, ...]


@dataclass(frozen=True, kw_only=True)
class Trigger(Element):
    """Trigger, which is fulfilled if one of its groups holds; without groups it never is."""

    condition_group: tuple[ConditionGroup, ...] = ()
