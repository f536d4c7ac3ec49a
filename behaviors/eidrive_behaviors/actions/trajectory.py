"""FollowTrajectoryAction: move along a given curve, at the actor's speed or at given times."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
from py_trees.common import Status

from eidrive_behaviors.actions.following import PathPursuit, RateLimitedValue, largest_curvature, wheelbase_of
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Domain,
    EntityAbsentError,
    Goal,
    ResolvedPosition,
    RuntimeContext,
    TrajectoryCurve,
    TrajectoryProgress,
    has_times,
    model,
    resolve_position,
    sample_trajectory,
)
from eidrive_scenario.api.common import EPSILON, Pose, wrap_angle

APART = 1.0
"""Who is further from the place on the trajectory at which he begins is put there, as by a teleport [m]."""
TIMED = {
    "polyline": "each vertex a time",
    "clothoid": "startTime and stopTime",
    "clothoid_spline": "timeEnd",
    "nurbs": "each control point a time",
}
"""By shape, what says when it is passed."""


class FollowTrajectoryAction(ActionBehaviour):
    """Moves the actor along a trajectory, from its start (or `initialDistanceOffset`) to its end.

    Without timing the actor keeps its own speed, which other actions may set, and only the way is given. With timing
    the vertex of time v is passed at `scale * v + offset`, counted from the start of the run or of the action; in the
    following mode `follow` the speed then changes linearly between the vertices. After the end the actor keeps its
    speed and looks for its lane.

    The heading is the one that the file gives, else that of the curve. A negative speed leads backwards: an actor that
    looks along the curve goes back on it, and straight on beyond its start. One that looks the other way as the action
    starts (by its own heading, by those of the file, or by the lane in which an actor without a place appears) drives
    tail first to the end. Whether the position or the speed is set first in Init does not matter.

    In the mode `position` the actor is put on the trajectory. With `follow` a vehicle drives there from where it is and
    leaves the curve where its front wheels cannot turn as far; until it is on it again it catches up with the times
    within its Performance. Headings that the file gives are taken at their word in both.
    """

    action: model.FollowTrajectoryAction

    def __init__(
        self,
        action: model.FollowTrajectoryAction,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        self._pursuit: PathPursuit | None = None
        self._run: RateLimitedValue | None = None
        self._followed: TrajectoryProgress | None = None
        self._trajectory = self._found()
        self._timing = action.time_reference.timing
        if self._timing is not None and not has_times(self._trajectory.shape.chosen()):
            self._timing = None
            hint = f"give {next(TIMED[shape] for shape in TIMED if getattr(self._trajectory.shape, shape) is not None)}"
            what = "keeps the actor's own speed: its Timing has nothing to scale, as the trajectory has no times"
            context.warnings += self.error(what, f"{hint}, or write <None/> for the TimeReference").diagnostics

    @property
    def controls(self) -> Domain:
        """The way alone, or the speed too."""
        return Domain.LATERAL if self._timing is None else Domain.LATERAL | Domain.LONGITUDINAL

    @property
    def is_actor_missing(self) -> bool:
        """Never: who is not in the world appears on the trajectory."""
        return False

    def initialise(self) -> None:
        """Lay the trajectory out; positions relative to entities mean where those are now."""
        present, motion = self.actor.present, self.actor.motion
        spline = self._trajectory.shape.clothoid_spline
        if not present and spline is not None and spline.clothoid_spline_segment[0].position_start is None:
            raise EntityAbsentError(self.actor.name)
        self._layout: TrajectoryCurve = sample_trajectory(self._trajectory, self._resolved, motion.pose)
        self._s = self._offset()
        self._progress = TrajectoryProgress(self._layout, self._s)
        self.actor.progress = self._followed = self._progress
        self._head_start = self._layout.time_at(self._s) if self._s > 0.0 else 0.0
        self._started = self.context.time
        follow = self.action.trajectory_following_mode.following_mode is model.FollowingMode.FOLLOW
        self._drives = follow and not self._layout.given and isinstance(self.actor.entity, model.Vehicle)
        swings = follow and self._timing is not None and self._trajectory.shape.polyline is not None
        self._speeds = self._layout.speeds_from(abs(motion.speed)) if swings else None
        self._looks = motion.pose.h if present else None
        """Heading before the action [rad]; None for an actor that the trajectory brings into the world."""
        self._put: Pose | None = None
        self._pursuit = self._run = None
        self._begun = self._turned = self._jumps = False
        if self._timing is not None and not (self._drives and present):
            self._s = self._layout.at_time(self._clock(0.0), self._speeds)

    def _offset(self) -> float:
        """Where on the trajectory the action begins [m]."""
        offset = self.action.initial_distance_offset or 0.0
        return offset if self._layout.closed else min(offset, self._layout.length)

    def settle(self) -> None:
        """All actions of Init have started: the speed, and whoever is placed by another one, are known."""
        placed_here = self._put is not None and self.actor.motion.pose == self._put
        self._look()
        self._turn()
        if placed_here:
            self._enter(self._pose(self._s))

    def _look(self) -> None:
        """Notice where the actor looks, if another action has placed it."""
        if self._put is not None and self.actor.motion.pose != self._put:
            self._looks = self.actor.motion.pose.h
            self._put = None

    def _enter(self, pose: Pose) -> None:
        self.context.add_actor(self.actor.name, ResolvedPosition(pose))
        self._put = self.actor.motion.pose

    def _begin(self) -> None:
        """The first step: from where the actor is by now."""
        motion, layout = self.actor.motion, self._layout
        self._begun = True
        self._look()
        vehicle = self.actor.entity
        if self._drives and self._put is None and isinstance(vehicle, model.Vehicle):
            if self._timing is not None:
                self._s = self._offset()
            self._pursuit = PathPursuit(layout, self._s, motion.pose, largest_curvature(vehicle), wheelbase_of(vehicle))
            if self._timing is not None:
                top, faster, slower = self.actor.limits()
                self._run = RateLimitedValue(
                    self._s, abs(motion.speed), up=faster, down=slower, lowest=0.0, highest=top
                )
        start = layout.at(self._s)
        self._jumps = math.hypot(start.x - motion.pose.x, start.y - motion.pose.y) > APART

    def _turn(self) -> None:
        """Decide whether the actor drives tail first, as soon as it moves."""
        speed = self.actor.motion.speed
        if self._turned or speed == 0.0:
            return
        self._turned = True
        if speed < 0.0:
            pose, tangent = self._layout.at(self._s), self._layout.tangent(self._s)
            looks = pose.h if self._layout.given else self._looks
            if looks is None:
                looks = self._looks_by_lane()
            self._progress.way = -1 if looks is not None and math.cos(looks - tangent) < 0.0 else 1

    def _looks_by_lane(self) -> float | None:
        """Heading of the lane or road on which the first vertex lies; None where that says nothing."""
        first = next(one for one in self._trajectory.walk() if isinstance(one, model.Position))
        on_lane = isinstance(first.chosen(), model.LanePosition | model.RoadPosition)
        return self._resolved(first).h if on_lane else None

    def terminate(self, new_status: Status) -> None:
        """Nothing measures along a trajectory that nobody follows any more."""
        if self._followed is not None and self.actor.progress is self._followed:
            self.actor.progress = None
        self._followed = None

    def update(self) -> Status:
        """The pose at the end of the step."""
        if self.actor.driven:
            return self._ask_driver()
        motion, dt, layout = self.actor.motion, self.context.dt, self._layout
        if dt > 0.0 and not self._begun:
            self._begin()
        if dt > 0.0:
            self._turn()
        if self._pursuit is not None or (dt == 0.0 and self._drives and self.actor.present and self._put is None):
            return self._drive(self._pursuit)
        way = self._progress.way
        if self._timing is None:
            after = self._s + way * motion.speed * dt
            done = not layout.closed and after > max(self._s, layout.length - EPSILON)
        else:
            clock = self._clock(dt)
            after = layout.at_time(clock, self._speeds)
            done = clock >= layout.end_time - EPSILON
            if dt > 0.0 and not (done and clock > layout.end_time + EPSILON):
                motion.speed = self._forwards(after) * (after - self._s) / dt
            if done:
                after += max(0.0, clock - layout.end_time) * self._timing.scale * abs(motion.speed)
        before, self._s = self._s, after
        self._progress.move(self.context.view.tick, before, after)
        pose = self._pose(after)
        if dt == 0.0 or not self.actor.present:
            self._enter(pose)
        else:
            rail = None if self._timing is not None else partial(self._carried, before)
            motion.move_to(pose, land=done, jump=self._jumps, rail=rail)
        self._jumps = False
        return Status.SUCCESS if done else Status.RUNNING

    def _carried(self, before: float, distance: float) -> Pose:
        """Return the pose after a step of another length than that of the speed: a distance action without limits."""
        self._s = before + self._progress.way * distance
        self._progress.move(self.context.view.tick, before, self._s)
        pose = self._pose(self._s)
        if self._pursuit is not None:
            self._pursuit.put(self._s, pose)
        return pose

    def _forwards(self, s: float) -> float:
        """+1 where the actor looks along the curve, -1 where it goes on it tail first."""
        if not self._layout.given:
            return self._progress.way
        return -1.0 if math.cos(self._layout.at(s).h - self._layout.tangent(s)) < -EPSILON else 1.0

    def _drive(self, pursuit: PathPursuit | None) -> Status:
        """The pose at the end of the step of a vehicle that follows as far as it can."""
        motion, dt, layout = self.actor.motion, self.context.dt, self._layout
        if pursuit is None or dt == 0.0:
            return Status.RUNNING
        way, before = self._progress.way, pursuit.s
        if self._run is not None:
            clock = self._clock(dt)
            beyond = max(0.0, clock - layout.end_time) * self._last_speed()
            wanted = layout.at_time(clock, self._speeds) + beyond
            self._run.value = pursuit.s
            if pursuit.on_path:
                self._run.keep(wanted, dt)
            else:
                self._run.advance(wanted, dt)
            motion.speed = way * self._run.rate
        pose = pursuit.advance(way * motion.speed * dt, dt, tail_first=way < 0)
        self._s = pursuit.s
        self._progress.move(self.context.view.tick, before, pursuit.s)
        done = not (layout.closed and self._run is None) and pursuit.s > max(before, layout.length - EPSILON)
        motion.move_to(pose, land=done, rail=None if self._run is not None else partial(self._carried, before))
        return Status.SUCCESS if done else Status.RUNNING

    def _last_speed(self) -> float:
        """At which a timed trajectory ends [m per s of its clock]."""
        if self._speeds is not None:
            return self._speeds[-1]
        times, stations = self._layout.times, self._layout.timed
        assert times is not None
        span = times[-1] - times[-2]
        return (stations[-1] - stations[-2]) / span if span > 0.0 else 0.0

    def _clock(self, dt: float) -> float:
        assert self._timing is not None
        elapsed = self.context.time + dt
        if self._timing.domain_absolute_relative is not model.ReferenceContext.RELATIVE:
            return (elapsed - self._timing.offset) / self._timing.scale
        return (elapsed - self._started - self._timing.offset) / self._timing.scale + self._head_start

    def _pose(self, s: float) -> Pose:
        pose = self._layout.extended(s)
        if self._progress.way > 0 or self._layout.given:
            return pose
        back = pose.turned(math.pi)
        return back._replace(h=wrap_angle(back.h))

    def _ask_driver(self) -> Status:
        count = max(2, math.ceil(self._layout.length / 2.0) + 1)
        points = np.array([self._layout.at(s)[:3] for s in np.linspace(self._s, self._layout.length, count).tolist()])
        goal = self.actor.goal
        self.actor.goal = replace(goal or Goal(), path=points, lap=None)
        here = self.actor.motion.pose
        return Status.SUCCESS if math.hypot(points[-1, 0] - here.x, points[-1, 1] - here.y) < 2.0 else Status.RUNNING

    def _resolved(self, position: model.Position) -> Pose:
        return resolve_position(position, self.context, self.actor.name).pose

    def _found(self) -> model.Trajectory:
        if self.action.trajectory is not None:
            return self.action.trajectory
        reference = self.action.catalog_reference
        if self.action.trajectory_ref is not None:
            if self.action.trajectory_ref.trajectory is not None:
                return self.action.trajectory_ref.trajectory
            reference = self.action.trajectory_ref.catalog_reference
        return self.context.catalog_entry(reference, model.Trajectory, self.action)

    def describe(self) -> str:
        """Which one."""
        timing = "at its own speed" if self._timing is None else "by its times"
        return f"follow trajectory {self._trajectory.name} {timing}"
