"""Conventions beyond the standard: properties that configure objects and controllers, and criteria of ScenarioRunner.

Criteria of ScenarioRunner are ParameterConditions named `criteria_…` in the stop trigger of the storyboard.
"""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.openscenario.model import Condition, ConditionGroup, Storyboard, Trigger
from eidrive_scenario.openscenario.model.controllers import Controller
from eidrive_scenario.openscenario.model.declarations import Property
from eidrive_scenario.openscenario.model.entities import MiscObject, Pedestrian, Vehicle

MODULE = "eidrive"
"""Value of the property `module` of a controller of this project."""


def property_entries(holder: Controller | MiscObject | Pedestrian | Vehicle) -> tuple[Property, ...]:
    """Return the properties of an object or controller in the order of the file."""
    return () if holder.properties is None else holder.properties.property


def is_agent_controller(controller: Controller) -> bool:
    """Return True if a controller has the property `module=eidrive`."""
    return any(entry.name == "module" and entry.value == MODULE for entry in property_entries(controller))


CRITERION_PREFIX = "criteria_"
"""Prefix of the name of a condition that is a criterion; the class of the criterion follows."""


def is_criterion(condition: Condition) -> bool:
    """Whether a condition is a criterion; its parameter need not be declared."""
    by_value = condition.by_value_condition
    return (
        isinstance(condition.name, str)
        and condition.name.startswith(CRITERION_PREFIX)
        and by_value is not None
        and by_value.parameter_condition is not None
    )


def criteria_of(storyboard: Storyboard) -> Iterator[Condition]:
    """Yield the criteria in the stop trigger of a storyboard."""
    trigger = storyboard.stop_trigger
    for group in trigger.condition_group if trigger is not None else ():
        yield from filter(is_criterion, group.condition)


def without_criteria(trigger: Trigger) -> Trigger:
    """Return a trigger without criteria and without the groups that contain nothing else."""
    groups = []
    for group in trigger.condition_group:
        conditions = tuple(condition for condition in group.condition if not is_criterion(condition))
        if conditions:
            groups.append(ConditionGroup(condition=conditions, line=group.line, source=group.source))
    return Trigger(condition_group=tuple(groups), line=trigger.line, source=trigger.source)
