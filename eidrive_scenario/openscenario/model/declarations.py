"""Parameters, variables and monitors: declared, assigned, constrained."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.element import Element, children
from eidrive_scenario.openscenario.model.enumerations import ParameterType, Rule
from eidrive_scenario.openscenario.model.scalars import ParameterName


@dataclass(frozen=True, kw_only=True)
class ValueConstraint(Element):
    """A comparison that a parameter's value has to pass."""

    rule: Rule
    value: str


@dataclass(frozen=True, kw_only=True)
class ValueConstraintGroup(Element):
    """Constraints that hold together; several groups of one parameter are alternatives."""

    value_constraint: tuple[ValueConstraint, ...]


@dataclass(frozen=True, kw_only=True)
class ParameterDeclaration(Element):
    """A parameter with its type and its default."""

    name: ParameterName
    parameter_type: ParameterType
    value: str
    constraint_group: tuple[ValueConstraintGroup, ...] = children(since="1.1")


@dataclass(frozen=True, kw_only=True)
class ParameterDeclarations(Element):
    """The parameters of a scope."""

    parameter_declaration: tuple[ParameterDeclaration, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ParameterAssignment(Element):
    """The value that a referenced entry gets for one of its parameters."""

    parameter_ref: ParameterName
    value: str


@dataclass(frozen=True, kw_only=True)
class ParameterAssignments(Element):
    """The values that a referenced entry gets for its parameters."""

    parameter_assignment: tuple[ParameterAssignment, ...] = ()


@dataclass(frozen=True, kw_only=True)
class VariableDeclaration(Element):
    """A variable: it may change during the run."""

    name: str
    variable_type: ParameterType
    value: str


@dataclass(frozen=True, kw_only=True)
class VariableDeclarations(Element):
    """The variables of a scenario."""

    variable_declaration: tuple[VariableDeclaration, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MonitorDeclaration(Element):
    """A boolean that tells an outside observer about the run."""

    name: str
    value: bool


@dataclass(frozen=True, kw_only=True)
class MonitorDeclarations(Element):
    """The monitors of a scenario."""

    monitor_declaration: tuple[MonitorDeclaration, ...] = ()
