"""FollowTrajectoryAction: motion along a given curve, at the actor's speed or at given times."""

from __future__ import annotations

import dataclasses
import math
from functools import partial

import numpy as np
from msgspec.structs import replace
from py_trees.common import Status

from eidrive_behaviors.actions.following import (
    PathPursuit,
    RateLimitedValue,
    largest_curvature,
    warn_of_missed_end,
    wheelbase_of,
)
from eidrive_behaviors.actions.routing import POINTS_APART, check_way
from eidrive_scenario.api.actions import (
    TIME_ATTRIBUTES,
    ActionBehaviour,
    Domain,
    EntityAbsentError,
    Goal,
    ResolvedPosition,
    TrajectoryCurve,
    TrajectoryProgress,
    has_times,
    model,
    on_surface,
    resolve_position,
    sample_trajectory,
)
from eidrive_scenario.api.common import EPSILON, Array, Pose, wrap_angle

ARRIVED = 2.0
"""Maximum distance to the end along the trajectory at which a driven vehicle has arrived [m]."""
MISSED = 10.0
"""Minimum distance of a driven vehicle from the end, once it is beside or beyond it, at which it has missed it [m]."""


class DrivenTrajectory:
    """Goal of a driven vehicle on a trajectory, from an arc length on [m].

    s       arc length of the vehicle [m], within the trajectory
    path    (M, 3) points [m]
    before  goal before this path
    """

    def __init__(self, layout: TrajectoryCurve, s: float) -> None:
        self.s = s
        self._away = 0.0
        self._layout = layout
        self.path = _points(layout, s)
        self.before = Goal()
        self._lap = _points(layout, 0.0) if layout.closed else None

    def move(self, pose: Pose) -> float:
        """Update `s`, and return the arc length [m] on the trajectory extended along its tangents."""
        layout = self._layout
        at = layout.track(pose.x, pose.y, self.s)
        self.s = at if layout.closed else min(max(at, 0.0), layout.length)
        end = layout.at(layout.length)
        self._away = math.hypot(pose.x - end.x, pose.y - end.y)
        return at

    @property
    def has_arrived(self) -> bool:
        """Whether the vehicle is at the end; False for a closed trajectory, which is driven in laps."""
        return self._has_passed and self._away < MISSED

    @property
    def has_missed(self) -> bool:
        """Whether the vehicle is beside or beyond the end, but not at it."""
        return self._has_passed and self._away >= MISSED

    @property
    def _has_passed(self) -> bool:
        return not self._layout.closed and self._layout.length - self.s <= ARRIVED

    def goal(self, before: Goal | None, speed: float | None) -> Goal:
        """Return the goal with this path; a target speed [m/s] replaces that of the goal before."""
        if before is not None and before.path is not self.path:
            self.before = before
        goal = replace(before or Goal(), path=self.path, lap=self._lap, is_route=False)
        return goal if speed is None else replace(goal, speed=speed, acceleration=0.0)


def _points(layout: TrajectoryCurve, start: float) -> Array:
    """Return points of a trajectory (M, 3) from an arc length [m] to its end."""
    count = max(2, math.ceil(layout.length / POINTS_APART) + 1)
    return np.array([layout.at(s)[:3] for s in np.linspace(start, layout.length, count).tolist()])


TELEPORT_DISTANCE = 1.0
"""Minimum distance to the start on the trajectory at which an actor is teleported there [m]."""


class FollowTrajectoryAction(ActionBehaviour):
    """Motion along a trajectory from its start (or `initialDistanceOffset`) to its end.

    Without timing the actor keeps its speed, which other actions may set, and only the path is specified. With timing
    the vertex of time v is passed at `scale * v + offset`, relative to the start of the run or of the action. The time
    to reach `initialDistanceOffset` is deducted from all v (1.3.1, FollowTrajectoryAction). In the following mode
    `follow` the speed then changes linearly between the vertices. After the end the actor keeps its speed and is
    matched to a lane.

    The heading is that of the file, else that of the curve. A positive speed moves along the curve; where the headings
    of the file are against it, the actor moves tail first, and its speed along the heading is negative. A negative
    speed moves backwards: an actor that faces along the curve goes back on it, and the action ends at the start. An
    actor that faces against the curve at the start of the action moves tail first to the end. Its direction is that of
    the headings of the file, of its heading, or of the lane in which an absent actor appears; outside of lanes such an
    actor faces against the curve. The order of position and speed in Init has no effect.

    In the mode `position` the actor is set onto the trajectory. With `follow` a vehicle drives there from its position
    and leaves the curve where its front wheels cannot turn far enough. Until it is back on the curve it catches up with
    the times within its Performance. Headings of the file are exact in both modes.
    """

    action: model.FollowTrajectoryAction

    def configure(self) -> None:
        """Resolve the trajectory, and warn of times and motions without effect."""
        self._pursuit: PathPursuit | None = None
        self._run: RateLimitedValue | None = None
        self._followed: TrajectoryProgress | None = None
        self._driven: DrivenTrajectory | None = None
        self._trajectory = self._resolve_trajectory()
        self._timing = self.action.time_reference.timing
        shape = self._trajectory.shape.chosen()
        if self._timing is not None and not has_times(shape):
            self._timing = None
            what = "the actor keeps its own speed: the trajectory has no times for Timing to scale"
            hint = f"specify {TIME_ATTRIBUTES[type(shape)]}, or <None/> as the TimeReference"
            self.warn(what, hint)
        if self._timing is not None and self._trajectory.closed and not self._is_relative:
            self._trajectory = dataclasses.replace(self._trajectory, closed=False)
            what = "closed has no effect on a trajectory with absolute times, which ends at its last point"
            self.warn(what, "write closed='false', or relative as the domain")
        if self._timing is None and any(isinstance(part, model.Motion) for part in shape.walk()):
            what = "the actor keeps its own speed: Motion has no effect on a trajectory without times"
            hint = f"specify {TIME_ATTRIBUTES[type(shape)]} with Timing, or the speed by another action"
            self.warn(what, hint)

    @property
    def _is_relative(self) -> bool:
        """Whether its times are relative to its start."""
        timing = self._timing
        return timing is not None and timing.domain_absolute_relative is model.ReferenceContext.RELATIVE

    @property
    def controls(self) -> Domain:
        """Lateral domain, and with timing the longitudinal domain too."""
        return Domain.LATERAL if self._timing is None else Domain.LATERAL | Domain.LONGITUDINAL

    @property
    def is_actor_missing(self) -> bool:
        """False: an absent actor appears on the trajectory."""
        return False

    def initialise(self) -> None:
        """Sample the trajectory, with positions relative to entities at their current state."""
        present, motion = self.actor.present, self.actor.motion
        spline = self._trajectory.shape.clothoid_spline
        if not present and spline is not None and spline.clothoid_spline_segment[0].position_start is None:
            raise EntityAbsentError(self.actor.name)
        roads = self.context.roads
        self._layout: TrajectoryCurve = sample_trajectory(self._trajectory, self._resolve_pose, motion.pose, roads)
        self._s = self._offset()
        self._progress = TrajectoryProgress(self._layout, self._s)
        self._followed = self._progress
        self.actor.set_progress(self._progress)
        self._head_start = self._layout.time_at(self._s) - self._layout.time_at(0.0)
        self._started = self.context.time
        follow = self.action.trajectory_following_mode.following_mode is model.FollowingMode.FOLLOW
        self._follows_limits = follow and not self._layout.given and isinstance(self.actor.entity, model.Vehicle)
        swings = follow and self._timing is not None and self._trajectory.shape.polyline is not None
        self._speeds = self._layout.speeds_from(abs(motion.speed)) if swings else None
        self._heading = motion.pose.h if present else None
        """Heading before the action [rad]; None for an actor that the trajectory adds to the world."""
        self._put: Pose | None = None
        self._driven = None
        self._pursuit = self._run = None
        self._direction_known = self._jumps = self._is_late = False
        self._begun_after = -1
        """Number of teleports of the actor before `_begin`, which a later teleport repeats; -1 requires it."""
        if self._timing is not None and not (self._follows_limits and present):
            self._s = self._timed_place(self._clock(0.0))

    def _offset(self) -> float:
        """Return the arc length at which the action starts [m]."""
        offset = self.action.initial_distance_offset or 0.0
        return offset if self._layout.closed else min(offset, self._layout.length)

    def finish_init(self) -> None:
        """Complete the start in Init: speed, and position set by another action, are known."""
        placed_here = self._put is not None and self.actor.motion.pose == self._put
        self._update_heading()
        self._determine_direction()
        if placed_here:
            self._enter(self._pose(self._s))

    def _update_heading(self) -> None:
        """Update the heading if another action has teleported the actor."""
        if self._put is not None and self.actor.motion.pose != self._put:
            self._heading = self.actor.motion.pose.h
            self._put = None

    def _enter(self, pose: Pose) -> None:
        self._update_backing()
        self.context.add_actor(self.actor.name, ResolvedPosition(pose))
        self._put = self.actor.motion.pose

    def _update_backing(self) -> None:
        """Update the direction of travel along the heading at the present place.

        Times set the sign of the speed themselves, and a driven vehicle moves by its own dynamics.
        """
        if self._timing is None and not self.actor.driven:
            self.actor.motion.set_backing(self._forwards(self._s) * self._progress.way < 0.0)

    def _begin(self) -> None:
        """Prepare the first step from the actor's current pose, and the first one after a teleport."""
        motion, layout = self.actor.motion, self._layout
        if self._begun_after >= 0 and not motion.teleported and self._timing is None and self._put != motion.pose:
            # A TeleportAction after the decision on the last step replaced that step.
            self._s = self._progress.at(self.context.view.tick - 1)
        self._begun_after = -1 if motion.teleported else motion.teleports  # This step shows the place of the teleport.
        self._update_heading()
        vehicle = self.actor.entity
        drives = self._follows_limits and self._put is None and self.actor.present
        if drives and isinstance(vehicle, model.Vehicle):
            if self._timing is not None:
                self._s = self._offset()
            self._pursuit = PathPursuit(layout, self._s, motion.pose, largest_curvature(vehicle), wheelbase_of(vehicle))
            if self._timing is not None:
                top, faster, slower = self.actor.limits()
                self._run = RateLimitedValue(
                    self._pursuit.s, abs(motion.speed), up=faster, down=slower, lowest=0.0, highest=top
                )
                behind = self._timed_place(self._clock(0.0)) - self._run.value
                self._is_late = abs(behind) > TELEPORT_DISTANCE
        start = layout.at(self._s)
        self._jumps = math.hypot(start.x - motion.pose.x, start.y - motion.pose.y) > TELEPORT_DISTANCE

    def _determine_direction(self) -> None:
        """Decide whether the actor moves tail first, as soon as it moves."""
        speed = self.actor.motion.speed
        if self._direction_known or speed == 0.0:
            return
        self._direction_known = True
        if speed < 0.0:
            pose, tangent = self._layout.at(self._s), self._layout.tangent(self._s)
            heading = pose.h if self._layout.given else self._heading
            if heading is None:
                heading = self._heading_by_lane()
            self._progress.way = -1 if heading is None or math.cos(heading - tangent) < 0.0 else 1

    def _heading_by_lane(self) -> float | None:
        """Return the driving direction of the lane of the first vertex [rad]; None outside of lanes."""
        first = next(element for element in self._trajectory.walk() if isinstance(element, model.Position))
        here, roads = resolve_position(first, self.context, self.actor.name).location, self.context.roads
        return roads.pose(here).h if roads is not None and here is not None and roads.on_road(here) else None

    def terminate(self, new_status: Status) -> None:
        """Remove the progress along the trajectory, so that no distance refers to it any more.

        Afterwards the speed of the actor refers to its heading. If the action is stopped, a driven vehicle leaves the
        trajectory.
        """
        if new_status is Status.INVALID and self._driven is not None:
            self.actor.end_path(self._driven.path, self._driven.before)
        if self._followed is not None:
            self.actor.motion.leave_curve(after_step=new_status is Status.SUCCESS)
            if self.actor.progress is self._followed:
                self.actor.set_progress(None)
        self._followed = None

    def update(self) -> Status:
        """Set the pose at the end of the step."""
        actor = self.actor
        if actor.driven:
            return self._set_driver_goal()
        motion, dt, layout = actor.motion, self.context.dt, self._layout
        if dt > 0.0 and self._begun_after != motion.teleports:
            self._begin()
        if dt > 0.0 and not self._direction_known:
            self._determine_direction()
        if self._pursuit is not None or (dt == 0.0 and self._follows_limits and actor.present and self._put is None):
            return self._drive(self._pursuit)
        way = self._progress.way
        if self._timing is None:
            # The step of a teleport covers no distance.
            after = self._s if motion.teleported else self._s + way * motion.speed * dt
            done = not layout.closed and self._leaves(self._s, after)
        else:
            clock = self._clock(dt)
            after = self._timed_place(clock)
            done = clock >= layout.end_time - EPSILON
            if dt == 0.0 and not done and self._speeds is None:
                motion.set_speed(self._forwards(after) * layout.speed_at(clock) / self._timing.scale)
            elif dt > 0.0 and not (done and clock > layout.end_time + EPSILON):
                # The step of an actor that enters is no motion: its speed is that of the next one.
                enters = not done and (motion.teleported or not actor.present)
                start, end = (after, self._timed_place(self._clock(2.0 * dt))) if enters else (self._s, after)
                motion.set_speed(self._forwards(after) * (end - start) / dt)
            if done:
                after += self._overrun(clock) * self._timing.scale * abs(motion.speed)
        before, self._s = self._s, after
        self._progress.move(self.context.view.tick, before, after)
        self._update_backing()
        pose = self._pose(after)
        if dt == 0.0 or not actor.present:
            self._enter(pose)
        else:
            rail = None if self._timing is not None else partial(self._pose_after_distance, before)
            motion.move_to(pose, land=done, jump=self._jumps, rail=rail)
        self._jumps = False
        return Status.SUCCESS if done else Status.RUNNING

    def _leaves(self, before: float, after: float) -> bool:
        """Return True if a step on an open trajectory reaches its end, or moves back to its start, with a warning."""
        at_start = after < min(before, EPSILON)
        if at_start:
            what = f"ends at the start of the trajectory, not at its end: {self.actor.name!r} moves back on it"
            hint = "with a negative speed, place the actor facing against the trajectory to reverse to its end"
            self.warn(what, hint)
        return at_start or after > max(before, self._layout.length - EPSILON)

    def _pose_after_distance(self, before: float, distance: float) -> Pose:
        """Return the pose after a step of another length, as a distance action without limits requests it."""
        self._s = before + self._progress.way * distance
        self._progress.move(self.context.view.tick, before, self._s)
        pose = self._pose(self._s)
        if self._pursuit is not None:
            self._pursuit.put(self._s, pose)
        return pose

    def _forwards(self, s: float) -> float:
        """Return +1 if the actor faces along the curve, -1 if it moves tail first."""
        if not self._layout.given:
            return self._progress.way
        return -1.0 if math.cos(self._layout.at(s).h - self._layout.tangent(s)) < -EPSILON else 1.0

    def _drive(self, pursuit: PathPursuit | None) -> Status:
        """Set the pose of a vehicle in the following mode `follow` at the end of the step."""
        motion, dt, layout = self.actor.motion, self.context.dt, self._layout
        if pursuit is None or dt == 0.0 or motion.teleported:
            return Status.RUNNING  # The step of a teleport covers no distance.
        way, before = self._progress.way, pursuit.s
        if self._run is not None:
            clock = self._clock(dt)
            beyond = max(0.0, clock - layout.end_time) * self._last_speed()
            wanted = self._timed_place(clock) + beyond
            self._run.value = pursuit.s
            if pursuit.on_path and not self._is_late:
                self._run.keep(wanted, dt)
            else:
                self._is_late = abs(self._run.advance(wanted, dt) - wanted) > EPSILON or not pursuit.on_path
            motion.set_speed(way * self._run.rate)
        pose = pursuit.advance(way * motion.speed * dt, dt, tail_first=way < 0)
        self._s = pursuit.s
        self._progress.move(self.context.view.tick, before, pursuit.s)
        done = not layout.closed and self._leaves(before, pursuit.s)
        if not pursuit.on_path:
            pose = self._beside_curve(pose, layout.extended(pursuit.s))
        motion.move_to(
            pose,
            land=done,
            rail=None if self._run is not None else partial(self._pose_after_distance, before),
        )
        return Status.SUCCESS if done else Status.RUNNING

    def _beside_curve(self, pose: Pose, goal: Pose) -> Pose:
        """Return a pose beside the trajectory as far above the roads as its place on the trajectory is."""
        roads = self.context.roads
        if roads is None or roads.is_flat:
            return pose
        below, there = on_surface(goal, roads, None, goal.z)
        level, here = on_surface(pose, roads, there, below.z)
        return pose if here is None else level._replace(z=level.z + goal.z - below.z)

    def _last_speed(self) -> float:
        """Return the speed at the end of a timed trajectory [m per s of its clock]."""
        if self._speeds is not None:
            return self._speeds[-1]
        times, stations = self._layout.times, self._layout.timed
        assert times is not None
        span = times[-1] - times[-2]
        return (stations[-1] - stations[-2]) / span if span > 0.0 else 0.0

    def _clock(self, dt: float) -> float:
        assert self._timing is not None
        elapsed = self.context.time + dt - (self._started if self._is_relative else 0.0)
        return (elapsed - self._timing.offset) / self._timing.scale + self._head_start

    def _timed_place(self, clock: float) -> float:
        """Return the arc length at a time of the clock [m]; the actor waits at `initialDistanceOffset`."""
        return max(self._layout.at_time(clock, self._speeds), self._offset())

    def _overrun(self, clock: float) -> float:
        """Return the part of this step after the end of the trajectory [s of its clock]."""
        assert self._timing is not None
        return min(max(0.0, clock - self._layout.end_time), self.context.dt / self._timing.scale)

    def _pose(self, s: float) -> Pose:
        pose = self._layout.extended(s)
        if self._progress.way > 0 or self._layout.given:
            return pose
        back = pose.turned(math.pi)
        return back._replace(h=wrap_angle(back.h))

    def _set_driver_goal(self) -> Status:
        driven, motion = self._driven, self.actor.motion
        if driven is None or driven.s != self._s:
            check_way(self, self._layout.length)
            driven = self._driven = DrivenTrajectory(self._layout, self._s)
        starts = motion.teleported or not self.actor.present
        if self.actor.present:
            s = driven.move(motion.pose)
            self._progress.move(self.context.view.tick, s, s)
        else:
            self._enter(self._pose(self._s))
        speed = None
        if self._timing is not None:
            speed = self._layout.speed_at(self._clock(0.0)) / self._timing.scale
            if starts:
                motion.set_speed(speed)
        self._s = driven.s
        self.actor.set_goal(driven.goal(self.actor.goal, speed))
        if driven.has_missed:
            warn_of_missed_end(self)
        return Status.SUCCESS if driven.has_arrived else Status.RUNNING

    def _resolve_pose(self, position: model.Position) -> Pose:
        return resolve_position(position, self.context, self.actor.name).pose

    def _resolve_trajectory(self) -> model.Trajectory:
        action, holder = self.action, self.action.trajectory_ref or self.action
        given = action.trajectory or holder.trajectory
        return given or self.context.catalog_entry(holder.catalog_reference, model.Trajectory, action)

    def describe(self) -> str:
        """Describe trajectory and timing."""
        timing = "at its own speed" if self._timing is None else "by its times"
        return f"follow trajectory {self._trajectory.name} {timing}"
