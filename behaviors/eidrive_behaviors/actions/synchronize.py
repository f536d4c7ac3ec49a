"""SynchronizeAction: arrive at the same time as another entity."""

from __future__ import annotations

import math
from enum import Enum

from py_trees.common import Status

from eidrive_behaviors.actions.following import check_other_entity, check_presence, warn_without_effect
from eidrive_behaviors.actions.speed import relative_speed
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Domain,
    EntityAbsentError,
    ResolvedPosition,
    TrajectoryCurve,
    TrajectoryProgress,
    facing,
    model,
    referenced_entities,
    resolve_position,
    trajectory_of,
)
from eidrive_scenario.api.common import EPSILON, LaneLocation, RoadNetwork, Route

JUST_PASSED = 10.0
"""Distance behind the actor, besides that of one step, up to which it has passed its target [m]; it drives around to a
target farther behind."""
ON_LINE = 0.1
"""Maximum speed difference to the linear last phase at which the first phase ends [m/s]."""
HARD = 8.0
"""Deceleration if the distance is too short for a lower one [m/s²]."""


class SynchronizationPhase(Enum):
    """Phase of the maneuver."""

    SWING = "swing"
    LAST = "last"
    WAIT = "wait"
    BRAKE = "brake"
    STEADY = "steady"


class SynchronizeAction(ActionBehaviour):
    """Speed control by which the actor is at its target when the master is at the master's target.

    With a final speed v1, the distance s and the master's time t there are two phases of equal and opposite
    acceleration a: a² t²/2 + a ((v0 + v1) t - 2 s) - (v1 - v0)²/2 = 0. The equation is solved in each step, as the
    master's arrival changes. In the last phase the speed is on the line that ends in v1. If the speed between the
    phases would be negative, the actor stops and waits. While the master stands and therefore never arrives, the actor
    stands too.

    Without a final speed the acceleration is constant. An actor that is too fast for it, and would have to reverse,
    uses the mean speed of that instant as its final speed. A steady state at the end shortens distance and time.
    A target relative to entities moves: it is expected at the arrival of the master where the speed of its last step
    brings it. The action ends with that arrival, also if the actor has overtaken its target.
    Distances are measured along the trajectory that an entity follows, else along its lane. An entity with a negative
    speed arrives backwards. A final speed opposite to the direction of motion cannot be reached on the way to the
    target: the actor arrives at standstill and changes to the final speed at once, which is a warning. The maximum
    speed of a vehicle limits its speed; if it therefore arrives late, this is a warning as well.
    """

    domains = Domain.LONGITUDINAL
    action: model.SynchronizeAction

    def initialise(self) -> None:
        """Start with the first phase."""
        check_other_entity(self, self.action.master_entity_ref)
        self._phase = SynchronizationPhase.SWING
        self._rising: bool | None = None
        self._last = (math.nan, math.nan)
        """Last distances of both to their targets [m]."""
        self._measured: tuple[TrajectoryCurve | None, ...] = ()
        """Trajectories along which the distances of both were measured last."""
        self._targets: dict[str, tuple[TrajectoryCurve, bool]] = {}
        """Per entity: its trajectory, and whether its target is a TrajectoryPosition on that trajectory."""
        own, master = self.action.target_position, self.action.target_position_master
        for name, target in ((self.actor.name, own), (self.action.master_entity_ref, master)):
            if name in referenced_entities(target):
                message = f"the target position of {name!r} moves with it, so that it is never reached"
                raise self.error(message, "specify a position that does not refer to it")
        self._moving = tuple(bool(referenced_entities(target)) for target in (own, master))
        """Whether each target moves with an entity."""
        self._ways: dict[str, tuple[tuple[LaneLocation, LaneLocation, Route | None, float], float | None]] = {}
        """Start, target, route and direction of each entity, and its distance along the roads [m]."""
        self._sense: float | None = None
        """-1 if the actor drives backwards, else +1; None before the first step."""
        self._mean: float | None = None
        """Arrival speed if none is specified and a constant deceleration would reverse the actor [m/s]."""

    def update(self) -> Status:
        """Set the speed for the step."""
        if self.actor.driven:
            warn_without_effect(self)
        check_presence(self, self.action.master_entity_ref)
        motion, dt, final = self.actor.motion, self.context.dt, self._final_speed()
        if motion.speed != 0.0 or self._sense is None:
            self._sense = math.copysign(1.0, motion.speed or final or 1.0)
        sense = self._sense
        try:
            master_speed = self.context.speed(self.action.master_entity_ref)
            way = self._distance(self.actor.name, self.action.target_position, sense)
            master_sense = math.copysign(1.0, master_speed)
            master_way = self._distance(self.action.master_entity_ref, self.action.target_position_master, master_sense)
        except EntityAbsentError:
            if dt > 0.0:
                raise
            return Status.RUNNING  # In Init a later action may place the entity.
        mine, theirs = self.action.target_tolerance or 0.0, self.action.target_tolerance_master or 0.0
        measured = tuple(
            self.context.actors[name].trajectory for name in (self.actor.name, self.action.master_entity_ref)
        )
        changed, self._measured = measured != self._measured, measured
        before, self._last = None if changed else self._last, (way, master_way)
        moves, master_moves = self._moving
        if (moves or master_moves) and (before is None or dt == 0.0):
            return Status.RUNNING  # Their speeds are known from the second step on.
        ahead = sense * motion.speed + (way - before[0]) / dt if moves and before is not None else 0.0
        speed = abs(master_speed)
        if master_moves and before is not None:
            speed = (before[1] - master_way) / dt
        time = max(master_way - theirs, EPSILON) / speed if speed > EPSILON else math.inf
        if (way < mine + EPSILON and not moves) or master_way < theirs + EPSILON or time < dt + EPSILON:
            if changed:
                return Status.RUNNING  # An action that starts in the same step may assign a trajectory.
            if final is not None:
                self._check_direction(final, sense)
                motion.set_speed(final)
            return Status.SUCCESS
        if math.isfinite(time):
            way += ahead * time
        way, present = max(way - mine, EPSILON), sense * motion.speed
        if final is None and self._mean is None and math.isfinite(time) and present > 2.0 * way / time:
            self._mean = way / time
        final = self._mean if final is None else max(0.0, sense * final)
        top = self.actor.limits()[0]
        if way > top * (time + dt) and not self.actor.driven:
            message = f"{self.actor.name} cannot arrive in time: this takes more than its maximum speed, {top:g} m/s"
            self.warn(message, "specify a shorter distance or more time")
        if final is not None:
            motion.set_speed(sense * min(self._next_speed(present, way, time, final, dt), top))
        elif math.isfinite(time):
            motion.set_speed(sense * min(present + 2.0 * (way / time - present) / time * dt, top))
        return Status.RUNNING

    def _check_direction(self, final: float, sense: float) -> None:
        """Add a warning if the final speed is opposite to the direction of motion [m/s]."""
        if final * sense < -EPSILON:
            way, bound = ("forwards", "at least") if sense > 0.0 else ("backwards", "at most")
            message = f"the speed changes to {final:g} m/s at once at the target, which the actor reaches {way}"
            self.warn(message, f"specify a final speed of {bound} 0 m/s")

    def _next_speed(self, speed: float, way: float, time: float, final: float, dt: float) -> float:
        """Return the speed at the end of the step, as all speeds in the direction of motion [m/s]."""
        steady = self._steady_distance(final)
        if steady > 0.0 and final > EPSILON:
            if way - steady < EPSILON or time - steady / final < EPSILON:
                self._phase = SynchronizationPhase.STEADY
            way, time = way - steady, time - steady / final
        if self._phase is SynchronizationPhase.STEADY:
            return final
        if math.isinf(time):
            return 0.0
        if self._phase is SynchronizationPhase.BRAKE:
            after = max(0.0, speed - HARD * dt)
            if after == 0.0:
                self._phase = SynchronizationPhase.SWING
            return after
        if self._phase is SynchronizationPhase.WAIT:
            if final < EPSILON or time >= 2.0 * way / final:
                return 0.0
            self._phase = SynchronizationPhase.LAST
        on_line = 2.0 * way / time - final
        if self._phase is SynchronizationPhase.LAST:
            return max(0.0, on_line)
        if abs(speed - on_line) < ON_LINE:
            self._phase = SynchronizationPhase.LAST
            return speed
        return self._swing(way, time, speed, final, dt)

    def _swing(self, way: float, time: float, speed: float, final: float, dt: float) -> float:
        b, change = (speed + final) * time - 2.0 * way, final - speed
        root = math.sqrt(b * b + time * time * change * change)
        acceleration = (-b + root if b < 0.0 else -b - root) / (time * time)
        if self._rising is None:
            self._rising = acceleration > 0.0
        elif self._rising != (acceleration > 0.0):
            self._phase = SynchronizationPhase.LAST
            return speed
        if 0.5 * (speed + final + acceleration * time) < 0.0:
            stop = 2.0 * speed * way / (speed * speed + final * final) if speed > EPSILON else 0.0
            if stop * speed > way:
                self._phase = SynchronizationPhase.BRAKE
                return max(0.0, speed - HARD * dt)
            acceleration = -speed / stop if stop > EPSILON else 0.0
            if speed + acceleration * dt <= EPSILON:
                self._phase = SynchronizationPhase.WAIT
                return 0.0
        return speed + acceleration * dt

    def _distance(self, name: str, position: model.Position, sense: float) -> float:
        """Return the distance of an entity to its target in its direction of motion [m]; negative after the target.

        It is measured along its trajectory, or along its lane on its route or the shortest way over the roads ahead.
        `sense` is -1 for an entity that drives backwards.
        """
        actor = self.context.actors[name]
        if actor.progress is not None:
            return self._along(actor.progress, name, position, sense)
        target: ResolvedPosition = resolve_position(position, self.context, name)
        here = self.context.pose(name)
        dx, dy = target.pose.x - here.x, target.pose.y - here.y
        straight = math.copysign(math.hypot(dx, dy), sense * (dx * math.cos(here.h) + dy * math.sin(here.h)))
        roads = self.context.roads
        start = self.context.location(name)
        if roads is None or start is None or target.location is None:
            return straight
        sense *= facing(self.context, name, start)
        key = start, target.location, actor.motion.route, sense
        if name not in self._ways or self._ways[name][0] != key:
            self._ways[name] = key, self._along_roads(roads, key, abs(self.context.speed(name)) * self.context.dt)
        way = self._ways[name][1]
        return straight if way is None else way

    def _along_roads(
        self, roads: RoadNetwork, between: tuple[LaneLocation, LaneLocation, Route | None, float], step: float
    ) -> float | None:
        """Return the distance along the lane on a route or over the roads [m]; None if these do not lead to the target.

        between  start, target, route and direction of motion;  step  way of one time step [m]
        """
        start, target, route, sense = between
        on_route = None if route is None else roads.distance(start, target, route=route, along_lane=True)
        if on_route is not None:
            return on_route[0] * sense
        shortest = roads.distance(start, target, along_lane=True)
        if shortest is None:
            return None
        way = shortest[0] * sense
        if way > -JUST_PASSED - step:
            return way
        ahead = roads.distance(start, target, sense=1 if sense > 0.0 else -1, along_lane=True)
        return way if ahead is None else abs(ahead[0])

    def _along(self, progress: TrajectoryProgress, name: str, position: model.Position, sense: float) -> float:
        """Return the distance along the trajectory of the entity, in its direction of motion [m]."""
        layout, here = progress.layout, progress.at(self.context.view.tick)
        frame = position.chosen()
        cached = self._targets.get(name)
        if cached is None or cached[0] is not layout:
            is_on_it = isinstance(frame, model.TrajectoryPosition) and (
                trajectory_of(frame, self.context, name).poses == layout.poses
            )
            self._targets[name] = cached = layout, is_on_it
        if cached[1] and isinstance(frame, model.TrajectoryPosition):
            target = frame.s
        else:
            pose = resolve_position(position, self.context, name).pose
            target = layout.project(pose.x, pose.y, here)[0]
        way = (target - here) * progress.way * sense
        return way % layout.length if layout.closed and layout.length > 0.0 else way

    def _final_speed(self) -> float | None:
        """Return the final speed within the maximum of the vehicle [m/s]; None if none is specified."""
        final = self.action.final_speed
        if final is None:
            return None
        if final.absolute_speed is not None:
            speed = final.absolute_speed.value
        else:
            assert final.relative_speed_to_master is not None
            relative, master = final.relative_speed_to_master, self.context.speed(self.action.master_entity_ref)
            speed = relative_speed(master, relative.value, relative.speed_target_value_type)
        return math.copysign(min(abs(speed), self.actor.limits()[0]), speed)

    def _steady_distance(self, final: float) -> float:
        """Return the length of the final segment at the final speed [m]."""
        speed = self.action.final_speed
        if speed is None:
            return 0.0
        of = speed.absolute_speed or speed.relative_speed_to_master
        if of is None:
            return 0.0
        if of.target_distance_steady_state is not None:
            return of.target_distance_steady_state.distance
        return of.target_time_steady_state.time * final if of.target_time_steady_state is not None else 0.0

    def describe(self) -> str:
        """Describe the master."""
        return f"arrive together with {self.action.master_entity_ref}"
