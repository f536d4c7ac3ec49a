"""Longitudinal actions: speed and longitudinal distance."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.content import ALL, Choice
from eidrive_scenario.openscenario.model.element import Element, attribute, child, element_type
from eidrive_scenario.openscenario.model.entities import EntityRef
from eidrive_scenario.openscenario.model.enumerations import (
    CoordinateSystem,
    DynamicsDimension,
    DynamicsShape,
    FollowingMode,
    LongitudinalDisplacement,
    SpeedTargetValueType,
)
from eidrive_scenario.openscenario.model.scalars import EntityName


@element_type
class DynamicConstraints(Element):
    """Limits of speed [m/s], acceleration and deceleration [m/s²] and their rates [m/s³]."""

    max_acceleration: float | None = None
    max_deceleration: float | None = None
    max_speed: float | None = None
    max_acceleration_rate: float | None = attribute(since="1.2")
    max_deceleration_rate: float | None = attribute(since="1.2")


@element_type
class TransitionDynamics(Element):
    """Dynamics of a transition: shape, and time [s], distance [m] or rate."""

    dynamics_dimension: DynamicsDimension
    dynamics_shape: DynamicsShape
    value: float
    following_mode: FollowingMode | None = attribute(since="1.2")


@element_type
class AbsoluteTargetSpeed(Element):
    """Target speed [m/s]."""

    value: float


@element_type
class RelativeTargetSpeed(Element):
    """Target speed relative to an entity: difference [m/s] or factor."""

    entity_ref: EntityName
    continuous: bool
    speed_target_value_type: SpeedTargetValueType
    value: float


@element_type
class SpeedActionTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a speed action."""

    relative_target_speed: RelativeTargetSpeed | None = None
    absolute_target_speed: AbsoluteTargetSpeed | None = None


@element_type
class SpeedAction(Element, content=ALL):
    """Action that changes the speed of an entity."""

    speed_action_dynamics: TransitionDynamics
    speed_action_target: SpeedActionTarget


@element_type
class SpeedProfileEntry(Element):
    """Speed [m/s] and duration of the transition to it [s]."""

    speed: float
    time: float | None = None


@element_type
class SpeedProfileAction(Element):
    """Action with a series of speeds."""

    following_mode: FollowingMode
    entity_ref: EntityName | None = attribute(since="1.2")
    dynamic_constraints: DynamicConstraints | None = None
    entity_ref_element: EntityRef | None = child(until="1.2", deprecated="1.2", name="EntityRef")
    speed_profile_entry: tuple[SpeedProfileEntry, ...]


@element_type
class LongitudinalDistanceAction(Element, content=ALL):
    """Action that keeps a distance [m] or a time gap [s] to an entity."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    time_gap: float | None = None
    displacement: LongitudinalDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


@element_type
class LongitudinalAction(Element, content=Choice(empty_until="1.2")):
    """Longitudinal action of an entity."""

    speed_action: SpeedAction | None = None
    longitudinal_distance_action: LongitudinalDistanceAction | None = None
    speed_profile_action: SpeedProfileAction | None = child(since="1.2")
