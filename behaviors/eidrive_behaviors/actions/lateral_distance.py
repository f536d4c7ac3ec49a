"""LateralDistanceAction: keep a lateral distance to an entity."""

from __future__ import annotations

import math

from py_trees.common import Status

from eidrive_behaviors.actions.following import check_other_entity, check_presence, warn_without_effect
from eidrive_behaviors.actions.lane_change import STANDING
from eidrive_behaviors.actions.longitudinal_distance import LEAST_SHARE, STIFFNESS, infinite_if_none
from eidrive_scenario.api.actions import (
    STEEPEST,
    ActionBehaviour,
    Domain,
    LateralStep,
    distance,
    model,
    resolve_coordinate_system,
    same_way,
)

REACHED = 0.01
"""Maximum distance error at which an action that is not continuous ends [m]."""


class LateralDistanceAction(ActionBehaviour):
    """Lateral distance of `distance` meters to an entity, on the side of `displacement` (any: the current side).

    Left and right refer to the heading of the reference entity in each step. With limits the lateral speed is at most
    the forward speed. Without an acceleration limit the actor moves sideways at `maxSpeed`; without any limit it moves
    at once. With an acceleration limit it follows like a critically damped spring with the stiffness of
    LongitudinalDistanceAction, 0.4 times the limit. Free space is measured between the sides of both boxes, as if both
    were parallel to the lane.

    In the entity frame the distance is also measured across the lane at the position of the actor. The axis of the
    actor turns with the motion that the distance commands, which would cause oscillation. In the world frame it is that
    along y; an actor whose lane is at an angle to x moves so much farther, along y it has no effect. The standard does
    not specify the course of the distance; the distance actions of esmini have such a spring.
    """

    domains = Domain.LATERAL
    action: model.LateralDistanceAction

    @property
    def at_once(self) -> bool:
        """True for a distance that is reached at once and not kept."""
        return model.is_immediate(self.action) and not self.action.continuous and not self.actor.driven

    def initialise(self) -> None:
        """Reset the rate; without a displacement select the current side."""
        check_other_entity(self, self.action.entity_ref)
        self._rate = 0.0
        self._frame = resolve_coordinate_system(self.action.coordinate_system)
        if self.actor.motion.location is None:
            self.actor.motion.snap_to_lane()
        if self.actor.motion.location is None and not self.actor.driven:
            what = f"no effect on {self.actor.name!r}, which is off the road at the start"
            self.warn(what, "place the actor on a lane first")
        self._nearest_side = -1.0 if self._lateral_gap() > 0.0 else 1.0

    def update(self) -> Status:
        """Set the offset at the end of the step."""
        motion, dt = self.actor.motion, self.context.dt
        here, roads = motion.location, self.context.roads
        if self.actor.driven:
            warn_without_effect(self)
        check_presence(self, self.action.entity_ref)
        is_other_present = self.context.actors[self.action.entity_ref].present
        if self.actor.driven or not is_other_present or here is None or roads is None:
            return Status.RUNNING if self.action.continuous else Status.SUCCESS
        error = self._side() * self._wanted_gap() + self._lateral_gap()
        if math.isnan(error):
            return Status.RUNNING
        share = abs(math.cos(motion.course)) if self._frame == "world" else 1.0
        if share < LEAST_SHARE:
            self.warn(f"no effect while {self.actor.name!r} moves along the axis of the distance")
            return Status.RUNNING
        error /= share
        sideways = self._lateral_displacement(error, dt)
        most = STEEPEST * abs(motion.speed) * dt
        jumps = abs(sideways) > most
        if jumps and self.action.dynamic_constraints is not None:
            jumps, sideways = False, math.copysign(most, sideways)
            self._rate = sideways / dt
        offset = here.offset * roads.driving_direction(here.road, here.lane) + sideways * motion.direction
        ends = abs(error - sideways) * share < REACHED and not self.action.continuous
        heading = 0.0 if ends or jumps or abs(motion.speed) <= STANDING else None
        motion.set_lateral_step(LateralStep(offset, heading, shortens_distance=not jumps))
        return Status.SUCCESS if ends else Status.RUNNING

    def _lateral_displacement(self, error: float, dt: float) -> float:
        """Return the displacement to the left in this step [m], at the rate of its start (forward Euler)."""
        limits = self.action.dynamic_constraints
        if limits is None or dt == 0.0:
            return error if limits is None else 0.0
        way = self._rate * dt
        top, faster = infinite_if_none(limits.max_speed), infinite_if_none(limits.max_acceleration)
        slower = faster if limits.max_deceleration is None else limits.max_deceleration
        if math.isinf(faster):
            rate = (error - way) / dt
        else:
            stiffness = STIFFNESS * faster
            pull = stiffness * error - 2.0 * math.sqrt(stiffness) * self._rate
            limit = faster if pull * self._rate >= 0.0 else slower
            rate = self._rate + min(max(pull, -limit), limit) * dt
        self._rate = min(max(rate, -top), top)
        return way

    def _side(self) -> float:
        """Return +1.0 for a place to the left of the reference entity as the actor faces, -1.0 for one to its right."""
        displacement = self.action.displacement
        if displacement in (None, model.LateralDisplacement.ANY):
            return self._nearest_side
        left = displacement is model.LateralDisplacement.LEFT_TO_REFERENCED_ENTITY
        way = same_way(self.context, self.actor.name, self.action.entity_ref, self._frame)
        return way if left else -way

    def _lateral_gap(self) -> float:
        """Return the lateral distance to the other entity, positive to the left [m].

        It is that of the reference points, or of the centers of the boxes for free space.
        """
        me, other, frame = self.actor.name, self.action.entity_ref, self._frame
        here, roads = self.actor.motion.location, self.context.roads
        if frame == "entity" and here is not None and roads is not None:
            lane = roads.pose(here).h + (0.0 if self.actor.motion.direction > 0 else math.pi)
            mine, theirs = self.context.pose(me), self.context.pose(other)
            beside = (theirs.y - mine.y) * math.cos(lane) - (theirs.x - mine.x) * math.sin(lane)
        else:
            beside = distance(self.context, me, other, frame=frame, kind="lateral", freespace=False)
            if frame == "world" and math.cos(self.actor.motion.course) < 0.0:
                beside = -beside
        if not self.action.freespace:
            return beside
        my_box, their_box = self._boxes()
        return beside + their_box.center.y * same_way(self.context, me, other, frame) - my_box.center.y

    def _wanted_gap(self) -> float:
        """Return the wanted distance between both reference points, or both centers for free space [m]."""
        apart = self.action.distance or 0.0
        if self.action.freespace:
            apart += 0.5 * sum(box.dimensions.width for box in self._boxes())
        return apart

    def _boxes(self) -> tuple[model.BoundingBox, model.BoundingBox]:
        actors = self.context.actors
        return self.actor.entity.bounding_box, actors[self.action.entity_ref].entity.bounding_box

    def describe(self) -> str:
        """Describe distance and entity."""
        held = "keep" if self.action.continuous else "reach"
        return f"{held} {self.action.distance or 0.0:g} m beside {self.action.entity_ref}"
