"""Conditions on time, parameters, variables and the storyboard."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.openscenario.model.content import Choice
from eidrive_scenario.openscenario.model.element import Element, child, element_type
from eidrive_scenario.openscenario.model.enumerations import Rule, StoryboardElementState, StoryboardElementType
from eidrive_scenario.openscenario.model.scalars import ParameterName, StoryboardElementName, VariableName
from eidrive_scenario.openscenario.model.signals import TrafficSignalCondition, TrafficSignalControllerCondition


@element_type
class ParameterCondition(Element):
    """Condition on the value of a parameter."""

    parameter_ref: ParameterName
    rule: Rule
    value: str


@element_type
class VariableCondition(Element):
    """Condition on the value of a variable."""

    variable_ref: VariableName
    rule: Rule
    value: str


@element_type
class TimeOfDayCondition(Element):
    """Condition on the simulated date and time."""

    date_time: datetime
    rule: Rule


@element_type
class SimulationTimeCondition(Element):
    """Condition on the time since the start of the run [s]."""

    rule: Rule
    value: float


@element_type
class StoryboardElementStateCondition(Element):
    """Condition on a state or transition of a storyboard element."""

    storyboard_element_ref: StoryboardElementName
    state: StoryboardElementState
    storyboard_element_type: StoryboardElementType


@element_type
class UserDefinedValueCondition(Element):
    """Condition on a value from outside the engine."""

    name: str
    rule: Rule
    value: str


@element_type
class ByValueCondition(Element, content=Choice(empty_until="1.2")):
    """Choice of one condition on a value."""

    parameter_condition: ParameterCondition | None = None
    time_of_day_condition: TimeOfDayCondition | None = None
    simulation_time_condition: SimulationTimeCondition | None = None
    storyboard_element_state_condition: StoryboardElementStateCondition | None = None
    user_defined_value_condition: UserDefinedValueCondition | None = None
    traffic_signal_condition: TrafficSignalCondition | None = None
    traffic_signal_controller_condition: TrafficSignalControllerCondition | None = None
    variable_condition: VariableCondition | None = child(since="1.2")
