"""Actions of the scenario as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from eidrive_scenario.openscenario.model.content import ALL, Choice
from eidrive_scenario.openscenario.model.element import Element, child, text, visible_parameters
from eidrive_scenario.openscenario.model.environment import EnvironmentAction
from eidrive_scenario.openscenario.model.positions import Position
from eidrive_scenario.openscenario.model.scalars import EntityName, MonitorName, ParameterName, VariableName
from eidrive_scenario.openscenario.model.signals import InfrastructureAction
from eidrive_scenario.openscenario.model.traffic import TrafficAction


@dataclass(frozen=True, kw_only=True)
class AddEntityAction(Element, content=ALL):
    """Brings an entity in at a position."""

    position: Position


@dataclass(frozen=True, kw_only=True)
class DeleteEntityAction(Element):
    """Takes an entity away."""


@dataclass(frozen=True, kw_only=True)
class EntityAction(Element, content=Choice(empty_until="1.2")):
    """Brings an entity in or takes it away."""

    entity_ref: EntityName
    add_entity_action: AddEntityAction | None = None
    delete_entity_action: DeleteEntityAction | None = None


@dataclass(frozen=True, kw_only=True)
class ParameterSetAction(Element):
    """Sets a parameter (deprecated since 1.2: use a variable)."""

    value: str


@dataclass(frozen=True, kw_only=True)
class ParameterAddValueRule(Element):
    """Adds to a parameter."""

    value: float


@dataclass(frozen=True, kw_only=True)
class ParameterMultiplyByValueRule(Element):
    """Multiplies a parameter."""

    value: float


@dataclass(frozen=True, kw_only=True)
class ModifyRule(Element, content=Choice(empty_until="1.2")):
    """How a parameter is modified."""

    add_value: ParameterAddValueRule | None = None
    multiply_by_value: ParameterMultiplyByValueRule | None = None


@dataclass(frozen=True, kw_only=True)
class ParameterModifyAction(Element, content=ALL):
    """Modifies a parameter (deprecated since 1.2: use a variable)."""

    rule: ModifyRule


@dataclass(frozen=True, kw_only=True)
class ParameterAction(Element, content=Choice(empty_until="1.2")):
    """Sets or modifies a parameter (deprecated since 1.2: use a variable)."""

    parameter_ref: ParameterName
    set_action: ParameterSetAction | None = child(deprecated="1.2")
    modify_action: ParameterModifyAction | None = child(deprecated="1.2")


@dataclass(frozen=True, kw_only=True)
class VariableSetAction(Element):
    """Sets a variable."""

    value: str


@dataclass(frozen=True, kw_only=True)
class VariableAddValueRule(Element):
    """Adds to a variable."""

    value: float


@dataclass(frozen=True, kw_only=True)
class VariableMultiplyByValueRule(Element):
    """Multiplies a variable."""

    value: float


@dataclass(frozen=True, kw_only=True)
class VariableModifyRule(Element, content=Choice(empty_until="1.2")):
    """How a variable is modified."""

    add_value: VariableAddValueRule | None = None
    multiply_by_value: VariableMultiplyByValueRule | None = None


@dataclass(frozen=True, kw_only=True)
class VariableModifyAction(Element, content=ALL):
    """Modifies a variable."""

    rule: VariableModifyRule


@dataclass(frozen=True, kw_only=True)
class VariableAction(Element, content=Choice(empty_until="1.2")):
    """Sets or modifies a variable."""

    variable_ref: VariableName
    set_action: VariableSetAction | None = None
    modify_action: VariableModifyAction | None = None


@dataclass(frozen=True, kw_only=True)
class SetMonitorAction(Element):
    """Sets a monitor."""

    monitor_ref: MonitorName
    value: bool


@dataclass(frozen=True, kw_only=True)
class GlobalAction(Element, content=Choice(empty_until="1.2")):
    """What concerns no single entity."""

    environment_action: EnvironmentAction | None = None
    entity_action: EntityAction | None = None
    infrastructure_action: InfrastructureAction | None = None
    set_monitor_action: SetMonitorAction | None = child(since="1.3")
    parameter_action: ParameterAction | None = child(deprecated="1.2")
    traffic_action: TrafficAction | None = None
    variable_action: VariableAction | None = child(since="1.2")


@dataclass(frozen=True, kw_only=True)
class CustomCommandAction(Element):
    """A command to the engine; its type says in which language."""

    type: str
    content: str = text()
    scope: Any = visible_parameters()


@dataclass(frozen=True, kw_only=True)
class UserDefinedAction(Element):
    """What the standard has no word for."""

    custom_command_action: CustomCommandAction
