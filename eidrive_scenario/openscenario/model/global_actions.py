"""Global and user-defined actions."""

from __future__ import annotations

from typing import Any

from eidrive_scenario.openscenario.model.declarations import EntityName, MonitorName, ParameterName, VariableName
from eidrive_scenario.openscenario.model.element import (
    ALL,
    Choice,
    Element,
    child,
    element_type,
    text,
    visible_parameters,
)
from eidrive_scenario.openscenario.model.environment import EnvironmentAction
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.signals import InfrastructureAction
from eidrive_scenario.openscenario.model.traffic import TrafficAction


@element_type
class AddEntityAction(Element, content=ALL):
    """Addition of an entity at a position."""

    position: Position


@element_type
class DeleteEntityAction(Element):
    """Removal of an entity."""


@element_type
class EntityAction(Element, content=Choice(empty_until="1.2")):
    """Action that adds or removes an entity."""

    entity_ref: EntityName
    add_entity_action: AddEntityAction | None = None
    delete_entity_action: DeleteEntityAction | None = None


@element_type
class ParameterSetAction(Element):
    """Assignment to a parameter (deprecated since 1.2: use a variable)."""

    value: str


@element_type
class ParameterAddValueRule(Element):
    """Addition to a parameter."""

    value: float


@element_type
class ParameterMultiplyByValueRule(Element):
    """Multiplication of a parameter."""

    value: float


@element_type
class ModifyRule(Element, content=Choice(empty_until="1.2")):
    """Rule for the modification of a parameter."""

    add_value: ParameterAddValueRule | None = None
    multiply_by_value: ParameterMultiplyByValueRule | None = None


@element_type
class ParameterModifyAction(Element, content=ALL):
    """Modification of a parameter (deprecated since 1.2: use a variable)."""

    rule: ModifyRule


@element_type
class ParameterAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets or modifies a parameter (deprecated since 1.2: use a variable)."""

    parameter_ref: ParameterName
    set_action: ParameterSetAction | None = child(deprecated="1.2")
    modify_action: ParameterModifyAction | None = child(deprecated="1.2")


@element_type
class VariableSetAction(Element):
    """Assignment to a variable."""

    value: str


@element_type
class VariableAddValueRule(Element):
    """Addition to a variable."""

    value: float


@element_type
class VariableMultiplyByValueRule(Element):
    """Multiplication of a variable."""

    value: float


@element_type
class VariableModifyRule(Element, content=Choice(empty_until="1.2")):
    """Rule for the modification of a variable."""

    add_value: VariableAddValueRule | None = None
    multiply_by_value: VariableMultiplyByValueRule | None = None


@element_type
class VariableModifyAction(Element, content=ALL):
    """Modification of a variable."""

    rule: VariableModifyRule


@element_type
class VariableAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets or modifies a variable."""

    variable_ref: VariableName
    set_action: VariableSetAction | None = None
    modify_action: VariableModifyAction | None = None


@element_type
class SetMonitorAction(Element):
    """Action that sets a monitor."""

    monitor_ref: MonitorName
    value: bool


@element_type
class GlobalAction(Element, content=Choice(empty_until="1.2")):
    """Action that does not apply to a single entity."""

    environment_action: EnvironmentAction | None = None
    entity_action: EntityAction | None = None
    infrastructure_action: InfrastructureAction | None = None
    set_monitor_action: SetMonitorAction | None = child(since="1.3")
    parameter_action: ParameterAction | None = child(deprecated="1.2")
    traffic_action: TrafficAction | None = None
    variable_action: VariableAction | None = child(since="1.2")


@element_type
class CustomCommandAction(Element):
    """Command to the engine; its type specifies the language."""

    type: str
    content: str = text()
    scope: Any = visible_parameters()


@element_type
class UserDefinedAction(Element):
    """Action that the standard does not define."""

    custom_command_action: CustomCommandAction
