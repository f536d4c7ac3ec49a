"""Lateral actions: lanes, lane offsets and lateral distance."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import ALL, Choice
from eidrive_scenario.openscenario.model.element import Element, attribute
from eidrive_scenario.openscenario.model.enumerations import CoordinateSystem, DynamicsShape, LateralDisplacement
from eidrive_scenario.openscenario.model.longitudinal import DynamicConstraints, TransitionDynamics
from eidrive_scenario.openscenario.model.scalars import EntityName


@dataclass(frozen=True, kw_only=True)
class AbsoluteTargetLane(Element):
    """Target lane by its id."""

    value: str


@dataclass(frozen=True, kw_only=True)
class RelativeTargetLane(Element):
    """Target lane relative to the lane of an entity."""

    entity_ref: EntityName
    value: int


@dataclass(frozen=True, kw_only=True)
class LaneChangeTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane change."""

    relative_target_lane: RelativeTargetLane | None = None
    absolute_target_lane: AbsoluteTargetLane | None = None


@dataclass(frozen=True, kw_only=True)
class LaneChangeAction(Element, content=ALL):
    """Action that changes the lane; offset from the lane center [m]."""

    target_lane_offset: float | None = None
    lane_change_action_dynamics: TransitionDynamics
    lane_change_target: LaneChangeTarget


@dataclass(frozen=True, kw_only=True)
class AbsoluteTargetLaneOffset(Element):
    """Target offset from the lane center [m]."""

    value: float


@dataclass(frozen=True, kw_only=True)
class RelativeTargetLaneOffset(Element):
    """Target offset relative to an entity [m]."""

    entity_ref: EntityName
    value: float


@dataclass(frozen=True, kw_only=True)
class LaneOffsetTarget(Element, content=Choice(empty_until="1.2")):
    """Target of a lane offset."""

    relative_target_lane_offset: RelativeTargetLaneOffset | None = None
    absolute_target_lane_offset: AbsoluteTargetLaneOffset | None = None


@dataclass(frozen=True, kw_only=True)
class LaneOffsetActionDynamics(Element):
    """Dynamics of a lane offset; maximum lateral acceleration [m/s²]."""

    dynamics_shape: DynamicsShape
    max_lateral_acc: float | None = None


@dataclass(frozen=True, kw_only=True)
class LaneOffsetAction(Element, content=ALL):
    """Action that changes the lateral offset in the lane."""

    continuous: bool
    lane_offset_action_dynamics: LaneOffsetActionDynamics
    lane_offset_target: LaneOffsetTarget


@dataclass(frozen=True, kw_only=True)
class LateralDistanceAction(Element, content=ALL):
    """Action that keeps a lateral distance to an entity [m]."""

    entity_ref: EntityName
    continuous: bool
    freespace: bool
    distance: float | None = None
    displacement: LateralDisplacement | None = attribute(since="1.1")
    coordinate_system: CoordinateSystem | None = attribute(since="1.1")
    dynamic_constraints: DynamicConstraints | None = None


@dataclass(frozen=True, kw_only=True)
class LateralAction(Element, content=Choice(empty_until="1.2")):
    """Lateral action of an entity."""

    lane_change_action: LaneChangeAction | None = None
    lane_offset_action: LaneOffsetAction | None = None
    lateral_distance_action: LateralDistanceAction | None = None
