"""Types of attributes, declarations of parameters, variables and monitors, and free-form properties."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec

from eidrive_scenario.openscenario.model.element import Element, about, children, text
from eidrive_scenario.openscenario.model.enumerations import ParameterType, Rule


class Limits(msgspec.Struct, frozen=True):
    """Minimum and maximum value of an integer type."""

    lowest: int
    highest: int


class NameOf(msgspec.Struct, frozen=True):
    """Kind of the referenced element: entity, parameter, variable, monitor, controller, sensor and others."""

    kind: str


INT = Limits(-(2**31), 2**31 - 1)

UnsignedInt = Annotated[int, Limits(0, 2**32 - 1)]
UnsignedShort = Annotated[int, Limits(0, 2**16 - 1)]

EntityName = Annotated[str, NameOf("entity")]
ParameterName = Annotated[str, NameOf("parameter")]
VariableName = Annotated[str, NameOf("variable")]
MonitorName = Annotated[str, NameOf("monitor")]
ControllerName = Annotated[str, NameOf("controller")]
SensorName = Annotated[str, NameOf("sensor")]
SignalControllerName = Annotated[str, NameOf("signal controller")]
StoryboardElementName = Annotated[str, NameOf("storyboard element")]


class Property(Element):
    """Name and value of a property."""

    name: str
    value: str
    scope: Any = about(None)


class File(Element):
    """File by its path."""

    filepath: str


class Directory(Element):
    """Folder by its path."""

    path: str


class CustomContent(Element):
    """Free text for specific tools."""

    content: str = text()


class Properties(Element):
    """Properties of an object beyond the standard."""

    property: tuple[Property, ...] = ()
    file: tuple[File, ...] = ()
    custom_content: tuple[CustomContent, ...] = children(since="1.2")


class ValueConstraint(Element):
    """Comparison that the value of a parameter must satisfy."""

    rule: Rule
    value: str


class ValueConstraintGroup(Element):
    """Constraints that are combined by AND; several groups of one parameter are alternatives."""

    value_constraint: tuple[ValueConstraint, ...]


class ParameterDeclaration(Element):
    """Parameter with its type and default."""

    name: ParameterName
    parameter_type: ParameterType
    value: str
    constraint_group: tuple[ValueConstraintGroup, ...] = children(since="1.1")


class ParameterDeclarations(Element):
    """Parameters of a scope."""

    parameter_declaration: tuple[ParameterDeclaration, ...] = ()


class ParameterAssignment(Element):
    """Value of one parameter of a referenced catalog entry."""

    parameter_ref: ParameterName
    value: str


class ParameterAssignments(Element):
    """Values of the parameters of a referenced catalog entry."""

    parameter_assignment: tuple[ParameterAssignment, ...] = ()


class VariableDeclaration(Element):
    """Variable, whose value may change during the run."""

    name: str
    variable_type: ParameterType
    value: str


class VariableDeclarations(Element):
    """Variables of a scenario."""

    variable_declaration: tuple[VariableDeclaration, ...] = ()


class MonitorDeclaration(Element):
    """Boolean value for external observers of the run."""

    name: str
    value: bool


class MonitorDeclarations(Element):
    """Monitors of a scenario."""

    monitor_declaration: tuple[MonitorDeclaration, ...] = ()


class CatalogReference(Element):
    """Reference to a catalog entry, with values of its parameters."""

    catalog_name: str
    entry_name: str
    parameter_assignments: ParameterAssignments | None = None
