"""Lateral actions: lanes, lane offsets and lateral distance."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.content import ALL, Choice
from eidrive_scenario.openscenario.model.element import Element, attribute, element_type
from eidrive_scenario.openscenario.model.enumerations import (
    CoordinateSystem,
    DynamicsShape,
    LaneLayerType,
    LateralDisplacement,
)
from eidrive_scenario.openscenario.model.longitudinal import DynamicConstraints, TransitionDynamics
from eidrive_scenario.openscenario.model.scalars import EntityName


@element_type
class AbsoluteTargetLane(Element):
    """Target lane by its id."""

    value: str
    layer: LaneLayerType | None = attribute(since="1.4")


@element_type
class RelativeTargetLane(Element):
    """Target lane relative to the lane of an entity."""

    entity_ref: EntityName
    value: int
    layer: LaneLayerType | None = attribute(since="1.4")


@element_type
class LaneChangeTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane change."""

    relative_target_lane: RelativeTargetLane | None = None
    absolute_target_lane: AbsoluteTargetLane | None = None


@element_type
class LaneChangeAction(Element, content=ALL):
    """Action that changes the lane; offset from the lane center [m]."""

    target_lane_offset: float | None = None
    lane_change_action_dynamics: TransitionDynamics
    lane_change_target: LaneChangeTarget


@element_type
class AbsoluteTargetLaneOffset(Element):
    """Target offset from the lane center [m]."""

    value: float


@element_type
class RelativeTargetLaneOffset(Element):
    """Target offset relative to an entity [m]."""

    entity_ref: EntityName
    value: float


@element_type
class LaneOffsetTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane offset."""

    relative_target_lane_offset: RelativeTargetLaneOffset | None = None
    absolute_target_lane_offset: AbsoluteTargetLaneOffset | None = None


@element_type
class LaneOffsetActionDynamics(Element):
    """Dynamics of a lane offset; maximum lateral acceleration [m/s²]."""

    dynamics_shape: DynamicsShape
    max_lateral_acc: float | None = None


@element_type
class LaneOffsetAction(Element, content=ALL):
    """Action that changes the lateral offset in the lane."""

    continuous: bool
    lane_offset_action_dynamics: LaneOffsetActionDynamics
    lane_offset_target: LaneOffsetTarget


@element_type
class LateralDistanceAction(Element, content=ALL):
    """Action that keeps a lateral distance to an entity [m]."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    displacement: LateralDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


@element_type
class LateralAction(Element, content=Choice(empty_until="1.2")):
    """Lateral action of an entity."""

    lane_change_action: LaneChangeAction | None = None
    lane_offset_action: LaneOffsetAction | None = None
    lateral_distance_action: LateralDistanceAction | None = None
