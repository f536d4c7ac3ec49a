"""Conditions on entities and values, and triggers: AND within a group of conditions, OR between groups."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from eidrive_scenario.openscenario.model.declarations import (
    EntityName,
    ParameterName,
    StoryboardElementName,
    VariableName,
)
from eidrive_scenario.openscenario.model.element import ALL, Choice, Element, about, attribute, child
from eidrive_scenario.openscenario.model.entities import ByObjectType, EntityRef
from eidrive_scenario.openscenario.model.enumerations import (
    AngleType,
    ConditionEdge,
    CoordinateSystem,
    DirectionalDimension,
    RelativeDistanceType,
    RoutingAlgorithm,
    Rule,
    StoryboardElementState,
    StoryboardElementType,
    TriggeringEntitiesRule,
)
from eidrive_scenario.openscenario.model.global_actions import TrafficSignalCondition, TrafficSignalControllerCondition
from eidrive_scenario.openscenario.model.positions import Position


class TriggeringEntities(Element):
    """Triggering entities, and whether any or all of them must satisfy the condition."""

    triggering_entities_rule: TriggeringEntitiesRule
    entity_ref: tuple[EntityRef, ...]


class EndOfRoadCondition(Element):
    """Condition: at the end of the road for a duration [s]."""

    duration: float


class CollisionCondition(Element, content=Choice(empty_until="1.2")):
    """Condition: collision with an entity, or with any entity of a type."""

    entity_ref: EntityRef | None = None
    by_type: ByObjectType | None = None


class OffroadCondition(Element):
    """Condition: off the road for a duration [s]."""

    duration: float


class TimeHeadwayCondition(Element):
    """Condition on the time headway to another entity [s]."""

    entity_ref: EntityName
    freespace: bool
    rule: Rule
    value: float
    along_route: bool | None = attribute(deprecated="1.1", required_until="1.0")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    relative_distance_type: RelativeDistanceType | None = attribute(since="1.1")
    routing_algorithm: RoutingAlgorithm | None = attribute(since="1.2")


class TimeToCollisionConditionTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a time to collision."""

    position: Position | None = None
    entity_ref: EntityRef | None = None


class TimeToCollisionCondition(Element, content=ALL):
    """Condition on the time to collision at constant speeds [s]."""

    freespace: bool
    rule: Rule
    value: float
    along_route: bool | None = attribute(deprecated="1.1", required_until="1.0")
    relative_distance_type: RelativeDistanceType | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    routing_algorithm: RoutingAlgorithm | None = attribute(since="1.2")
    time_to_collision_condition_target: TimeToCollisionConditionTarget


class AccelerationCondition(Element):
    """Condition on the acceleration [m/s²]."""

    rule: Rule
    value: float
    direction: DirectionalDimension | None = attribute(since="1.2")


class StandStillCondition(Element):
    """Condition: at standstill for a duration [s]."""

    duration: float


class SpeedCondition(Element):
    """Condition on the speed [m/s]."""

    rule: Rule
    value: float
    direction: DirectionalDimension | None = attribute(since="1.2")


class RelativeSpeedCondition(Element):
    """Condition on the speed relative to another entity [m/s]."""

    entity_ref: EntityName
    rule: Rule
    value: float
    direction: DirectionalDimension | None = attribute(since="1.2")


class TraveledDistanceCondition(Element):
    """Condition on the distance traveled since the start of the run [m]."""

    value: float


class ReachPositionCondition(Element, content=ALL):
    """Condition: position reached within a tolerance [m]."""

    tolerance: float
    position: Position


class DistanceCondition(Element, content=ALL):
    """Condition on the distance to a position [m]."""

    freespace: bool
    rule: Rule
    value: float
    along_route: bool | None = attribute(deprecated="1.1", required_until="1.0")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    relative_distance_type: RelativeDistanceType | None = attribute(since="1.1")
    routing_algorithm: RoutingAlgorithm | None = attribute(since="1.2")
    position: Position


class RelativeDistanceCondition(Element):
    """Condition on the distance to another entity [m]."""

    entity_ref: EntityName
    freespace: bool
    relative_distance_type: RelativeDistanceType
    rule: Rule
    value: float
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    routing_algorithm: RoutingAlgorithm | None = attribute(since="1.2")


class RelativeLaneRange(Element):
    """Range of lanes relative to the lane of the entity; an omitted limit is open."""

    from_: int | None = None
    to: int | None = None


class RelativeClearanceCondition(Element):
    """Condition: no entity in the lanes within the distances ahead and behind [m]."""

    opposite_lanes: bool
    free_space: bool
    distance_forward: float | None = None
    distance_backward: float | None = None
    relative_lane_range: tuple[RelativeLaneRange, ...] = ()
    entity_ref: tuple[EntityRef, ...] = ()


class AngleCondition(Element):
    """Condition on an angle, within a tolerance [rad]."""

    angle_type: AngleType
    angle: float
    angle_tolerance: float
    coordinate_system: CoordinateSystem | None = None


class RelativeAngleCondition(Element):
    """Condition on an angle relative to another entity, within a tolerance [rad]."""

    entity_ref: EntityName
    angle_type: AngleType
    angle: float
    angle_tolerance: float
    coordinate_system: CoordinateSystem | None = None


class EntityCondition(Element, content=Choice(empty_until="1.2")):
    """Choice of one condition on an entity."""

    end_of_road_condition: EndOfRoadCondition | None = None
    collision_condition: CollisionCondition | None = None
    offroad_condition: OffroadCondition | None = None
    time_headway_condition: TimeHeadwayCondition | None = None
    time_to_collision_condition: TimeToCollisionCondition | None = None
    acceleration_condition: AccelerationCondition | None = None
    stand_still_condition: StandStillCondition | None = None
    speed_condition: SpeedCondition | None = None
    relative_speed_condition: RelativeSpeedCondition | None = None
    traveled_distance_condition: TraveledDistanceCondition | None = None
    reach_position_condition: ReachPositionCondition | None = child(deprecated="1.2")
    distance_condition: DistanceCondition | None = None
    relative_distance_condition: RelativeDistanceCondition | None = None
    relative_clearance_condition: RelativeClearanceCondition | None = child(since="1.2")
    angle_condition: AngleCondition | None = child(since="1.3")
    relative_angle_condition: RelativeAngleCondition | None = child(since="1.3")


class ByEntityCondition(Element, content=ALL):
    """Condition on the state of entities."""

    triggering_entities: TriggeringEntities
    entity_condition: EntityCondition


class ParameterCondition(Element):
    """Condition on the value of a parameter."""

    parameter_ref: ParameterName
    rule: Rule
    value: str
    scope: Any = about(None)


class VariableCondition(Element):
    """Condition on the value of a variable."""

    variable_ref: VariableName
    rule: Rule
    value: str


class TimeOfDayCondition(Element):
    """Condition on the simulated date and time."""

    date_time: datetime
    rule: Rule


class SimulationTimeCondition(Element):
    """Condition on the time since the start of the run [s]."""

    rule: Rule
    value: float


class StoryboardElementStateCondition(Element):
    """Condition on a state or transition of a storyboard element."""

    storyboard_element_ref: StoryboardElementName
    state: StoryboardElementState
    storyboard_element_type: StoryboardElementType


class UserDefinedValueCondition(Element):
    """Condition on a value from outside the engine."""

    name: str
    rule: Rule
    value: str


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


class Condition(Element, content=Choice(empty_until="1.2")):
    """Condition with its edge and delay [s]."""

    condition_edge: ConditionEdge
    delay: float
    name: str
    by_entity_condition: ByEntityCondition | None = None
    by_value_condition: ByValueCondition | None = None


class ConditionGroup(Element):
    """Conditions that must hold at the same time."""

    condition: tuple[Condition, ...]


class Trigger(Element):
    """Trigger, which is fulfilled if one of its groups holds; without groups it never is."""

    condition_group: tuple[ConditionGroup, ...] = ()
