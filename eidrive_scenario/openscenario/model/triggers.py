"""Triggers: conditions are combined by AND within a group, and groups by OR."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.content import Choice
from eidrive_scenario.openscenario.model.element import Element, element_type
from eidrive_scenario.openscenario.model.entity_conditions import ByEntityCondition
from eidrive_scenario.openscenario.model.enumerations import ConditionEdge
from eidrive_scenario.openscenario.model.value_conditions import ByValueCondition


@element_type
class Condition(Element, content=Choice(empty_until="1.2")):
    """Condition with its edge and delay [s]."""

    condition_edge: ConditionEdge
    delay: float
    name: str
    by_entity_condition: ByEntityCondition | None = None
    by_value_condition: ByValueCondition | None = None


@element_type
class ConditionGroup(Element):
    """Conditions that must hold at the same time."""

    condition: tuple[Condition, ...]


@element_type
class Trigger(Element):
    """Trigger, which is fulfilled if one of its groups holds; without groups it never is."""

    condition_group: tuple[ConditionGroup, ...] = ()
