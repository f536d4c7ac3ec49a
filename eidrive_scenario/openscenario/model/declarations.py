"""Declarations, assignments and constraints of parameters, variables and monitors."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.element import Element, children, element_type
from eidrive_scenario.openscenario.model.enumerations import ParameterType, Rule
from eidrive_scenario.openscenario.model.scalars import ParameterName


@element_type
class ValueConstraint(Element):
    """Comparison that the value of a parameter must satisfy."""

    rule: Rule
    value: str


@element_type
class ValueConstraintGroup(Element):
    """Constraints that are combined by AND; several groups of one parameter are alternatives."""

    value_constraint: tuple[ValueConstraint, ...]


@element_type
class ParameterDeclaration(Element):
    """Parameter with its type and default."""

    name: ParameterName
    parameter_type: ParameterType
    value: str
    constraint_group: tuple[ValueConstraintGroup, ...] = children(since="1.1")


@element_type
class ParameterDeclarations(Element):
    """Parameters of a scope."""

    parameter_declaration: tuple[ParameterDeclaration, ...] = ()


@element_type
class ParameterAssignment(Element):
    """Value of one parameter of a referenced catalog entry."""

    parameter_ref: ParameterName
    value: str


@element_type
class ParameterAssignments(Element):
    """Values of the parameters of a referenced catalog entry."""

    parameter_assignment: tuple[ParameterAssignment, ...] = ()


@element_type
class VariableDeclaration(Element):
    """Variable, whose value may change during the run."""

    name: str
    variable_type: ParameterType
    value: str


@element_type
class VariableDeclarations(Element):
    """Variables of a scenario."""

    variable_declaration: tuple[VariableDeclaration, ...] = ()


@element_type
class MonitorDeclaration(Element):
    """Boolean value for external observers of the run."""

    name: str
    value: bool


@element_type
class MonitorDeclarations(Element):
    """Monitors of a scenario."""

    monitor_declaration: tuple[MonitorDeclaration, ...] = ()
