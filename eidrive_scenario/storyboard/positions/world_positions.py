"""Positions in world coordinates, absolute or relative to an entity."""

from __future__ import annotations

import math
from dataclasses import replace

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.orientations import angles

CARLA_PREFIX = "CARLA:"
"""Prefix of the description of a scenario in the axes of CARLA."""


def world_position(frame: model.WorldPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a WorldPosition; without z it is on the road."""
    side = -1.0 if left_handed(context) else 1.0
    h, p, r = side * (frame.h or 0.0), side * (frame.p or 0.0), frame.r or 0.0
    return on_ground(context, Pose(frame.x, side * frame.y, frame.z or 0.0, h, p, r), z_given=frame.z is not None)


def relative_world_position(
    frame: model.RelativeWorldPosition, context: ConditionContext, actor: str | None
) -> ResolvedPosition:
    """Resolve a position relative to an entity, along the axes of the world."""
    origin, side = context.pose(frame.entity_ref), -1.0 if left_handed(context) else 1.0
    x, y, z = origin.x + frame.dx, origin.y + side * frame.dy, origin.z + (frame.dz or 0.0)
    h, p, r = angles(_in_standard_axes(frame.orientation, side), origin)
    return on_ground(context, Pose(x, y, z, h, p, r), z_given=bool(frame.dz), near=frame.entity_ref)


def relative_object_position(
    frame: model.RelativeObjectPosition, context: ConditionContext, actor: str | None
) -> ResolvedPosition:
    """Resolve a position relative to an entity, along its heading."""
    origin, side = context.pose(frame.entity_ref), -1.0 if left_handed(context) else 1.0
    cos, sin, dy = math.cos(origin.h), math.sin(origin.h), side * frame.dy
    x = origin.x + frame.dx * cos - dy * sin
    y = origin.y + frame.dx * sin + dy * cos
    h, p, r = angles(_in_standard_axes(frame.orientation, side), origin)
    return on_ground(
        context, Pose(x, y, origin.z + (frame.dz or 0.0), h, p, r), z_given=bool(frame.dz), near=frame.entity_ref
    )


def left_handed(context: ConditionContext) -> bool:
    """Whether the world coordinates of the scenario have CARLA's axes: y to the right, headings clockwise, pitch up.

    As in ScenarioRunner, that is so if the description begins with `CARLA:`. Coordinates of roads and lanes keep the
    axes of the standard.
    """
    return str(context.scenario.document.file_header.description).startswith(CARLA_PREFIX)


def _in_standard_axes(orientation: model.Orientation | None, side: float) -> model.Orientation | None:
    """Convert an orientation to the axes of the standard; headings and pitches have the opposite sign in CARLA."""
    if orientation is None or side > 0.0:
        return orientation
    return replace(orientation, h=side * (orientation.h or 0.0), p=side * (orientation.p or 0.0))


def on_ground(context: ConditionContext, pose: Pose, *, z_given: bool, near: str | None = None) -> ResolvedPosition:
    """Return the position of a pose, on the road if there is one; the search begins at the actor `near`."""
    if context.roads is None:
        return ResolvedPosition(pose)
    here = context.roads.locate_at(pose.x, pose.y, None if near is None else context.location(near))
    if here is None:
        return ResolvedPosition(pose)
    if not z_given:
        ground = context.roads.lane_pose_at(here.road, here.lane, here.s, here.offset)
        level = ground.turned(wrap_angle(pose.h - ground.h))
        pose = Pose(pose.x, pose.y, ground.z, pose.h, pose.p or level.p, pose.r or level.r)
    return ResolvedPosition(pose, here)
