"""Declarations, assignments and constraints of parameters, variables and monitors."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.element import Element, children
from eidrive_scenario.openscenario.model.enumerations import ParameterType, Rule
from eidrive_scenario.openscenario.model.scalars import ParameterName


@dataclass(frozen=True, kw_only=True)
class ValueConstraint(Element):
    """Comparison that the value of a parameter must satisfy."""

    rule: Rule
    value: str


@dataclass(frozen=True, kw_only=True)
class ValueConstraintGroup(Element):
    """Constraints that are combined by AND; several groups of one parameter are alternatives."""

    value_constraint: tuple[ValueConstraint, ...]


@dataclass(frozen=True, kw_only=True)
class ParameterDeclaration(Element):
    """Parameter with its type and default."""

    name: ParameterName
    parameter_type: ParameterType
    value: str
    constraint_group: tuple[ValueConstraintGroup, ...] = children(since="1.1")


@dataclass(frozen=True, kw_only=True)
class ParameterDeclarations(Element):
    """Parameters of a scope."""

    parameter_declaration: tuple[ParameterDeclaration, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ParameterAssignment(Element):
    """Value of one parameter of a referenced catalog entry."""

    parameter_ref: ParameterName
    value: str


@dataclass(frozen=True, kw_only=True)
class ParameterAssignments(Element):
    """Values of the parameters of a referenced catalog entry."""

    parameter_assignment: tuple[ParameterAssignment, ...] = ()


@dataclass(frozen=True, kw_only=True)
class VariableDeclaration(Element):
    """Variable, whose value may change during the run."""

    name: str
    variable_type: ParameterType
    value: str


@dataclass(frozen=True, kw_only=True)
class VariableDeclarations(Element):
    """Variables of a scenario."""

    variable_declaration: tuple[VariableDeclaration, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MonitorDeclaration(Element):
    """Boolean value for external observers of the run."""

    name: str
    value: bool


@dataclass(frozen=True, kw_only=True)
class MonitorDeclarations(Element):
    """Monitors of a scenario."""

    monitor_declaration: tuple[MonitorDeclaration, ...] = ()
