"""FollowTrajectoryAction: move along a given curve, at the actor's speed or at given times."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from py_trees.common import Status

from eidrive_behaviors.actions.following import Pursuit, Tracker, largest_curvature, wheelbase_of
from eidrive_scenario.api import (
    ActionBehaviour,
    Domain,
    Goal,
    Layout,
    Place,
    Pose,
    Stage,
    has_times,
    lay_out,
    model,
    resolve,
)

TINY = 1e-6
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

    In the mode `position` the actor is put on the trajectory. With `follow` a vehicle drives there from where it is and
    leaves the curve where its front wheels cannot turn as far; until it is on it again it catches up with the times
    within its Performance. Headings that the file gives are taken at their word in both.
    """

    action: model.FollowTrajectoryAction

    def __init__(
        self,
        action: model.FollowTrajectoryAction,
        stage: Stage,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, stage, actor=actor, parent=parent)
        self._pursuit: Pursuit | None = None
        self._run: Tracker | None = None
        self._trajectory = self._found()
        self._timing = action.time_reference.timing
        if self._timing is not None and not has_times(self._trajectory.shape.chosen()):
            self._timing = None
            remedy = (
                f"give {next(TIMED[shape] for shape in TIMED if getattr(self._trajectory.shape, shape) is not None)}"
            )
            what = "keeps the actor's own speed: its Timing has nothing to scale, as the trajectory has no times"
            stage.warnings += self.problem(what, f"{remedy}, or write <None/> for the TimeReference").problems
        self._followed: Layout | None = None

    @property
    def controls(self) -> Domain:
        """The way alone, or the speed too."""
        return Domain.LATERAL if self._timing is None else Domain.LATERAL | Domain.LONGITUDINAL

    @property
    def performer_missing(self) -> bool:
        """Never: who is not in the world appears on the trajectory."""
        return False

    def initialise(self) -> None:
        """Lay the trajectory out; positions relative to entities mean where those are now."""
        self._layout: Layout = lay_out(self._trajectory, self._resolved, self.actor.motion.pose)
        self.actor.trajectory = self._followed = self._layout
        self._s = self.action.initial_distance_offset or 0.0
        self._head_start = self._layout.time_at(self._s) if self._s > 0.0 else 0.0
        self._started = self.stage.time
        follow = self.action.trajectory_following_mode.following_mode is model.FollowingMode.FOLLOW
        swings = follow and self._timing is not None and self._trajectory.shape.polyline is not None
        self._speeds = self._layout.speeds_from(abs(self.actor.motion.speed)) if swings else None
        self._backwards = self.actor.present and self.actor.motion.speed < 0.0
        self._pursuit = self._run = None
        if follow and self.actor.present and not self._layout.given and not self._backwards:
            self._pursue()
        if self._timing is not None and self._pursuit is None:
            self._s = self._layout.at_time(self._clock(0.0), self._speeds)
        here, start = self.actor.motion.pose, self._layout.at(self._s)
        self._jumps = math.hypot(start.x - here.x, start.y - here.y) > APART

    def _pursue(self) -> None:
        vehicle, motion = self.actor.entity, self.actor.motion
        if not isinstance(vehicle, model.Vehicle):
            return
        self._pursuit = Pursuit(self._layout, self._s, motion.pose, largest_curvature(vehicle), wheelbase_of(vehicle))
        if self._timing is not None:
            top, faster, slower = self.actor.limits()
            self._run = Tracker(self._s, motion.speed, up=faster, down=slower, lowest=0.0, highest=top)

    def terminate(self, new_status: Status) -> None:
        """Nothing measures along a trajectory that nobody follows any more."""
        if self._followed is not None and self.actor.trajectory is self._followed:
            self.actor.trajectory = None
        self._followed = None

    def update(self) -> Status:
        """The pose at the end of the step."""
        if self.actor.driven:
            return self._ask_driver()
        if self._pursuit is not None:
            return self._drive(self._pursuit)
        motion, dt, layout = self.actor.motion, self.stage.dt, self._layout
        if self._timing is None:
            after, done = self._s + abs(motion.speed) * dt, False
            if not layout.closed:
                done = dt > 0.0 and after > layout.length - TINY
        else:
            clock = self._clock(dt)
            after = layout.at_time(clock, self._speeds)
            done = clock >= layout.end_time - TINY
            if dt > 0.0 and not (done and clock > layout.end_time + TINY):
                motion.speed = math.copysign((after - self._s) / dt, motion.speed if self._backwards else 1.0)
        self._s = after
        pose = self._pose(after)
        if done:
            rest = self._rest(after, dt)
            pose = pose._replace(x=pose.x + rest * math.cos(pose.h), y=pose.y + rest * math.sin(pose.h))
        if dt == 0.0 or not self.actor.present:
            self.stage.enter(self.actor.name, Place(pose))
        else:
            motion.go_to(pose, land=done, jump=self._jumps)
        self._jumps = False
        return Status.SUCCESS if done else Status.RUNNING

    def _drive(self, pursuit: Pursuit) -> Status:
        """The pose at the end of the step of a vehicle that follows as far as it can."""
        motion, dt, layout = self.actor.motion, self.stage.dt, self._layout
        if dt == 0.0:
            return Status.RUNNING
        if self._run is not None:
            clock = self._clock(dt)
            beyond = max(0.0, clock - layout.end_time) * self._last_speed()
            wanted = layout.at_time(clock, self._speeds) + beyond
            self._run.value = pursuit.s
            if pursuit.on_path:
                self._run.keep(wanted, dt)
            else:
                self._run.advance(wanted, dt)
            motion.speed = self._run.rate
        pose = pursuit.advance(abs(motion.speed) * dt, dt)
        self._s = pursuit.s
        done = not (layout.closed and self._run is None) and pursuit.s > layout.length - TINY
        motion.go_to(pose, land=done)
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
        elapsed = self.stage.time + dt
        if self._timing.domain_absolute_relative is not model.ReferenceContext.RELATIVE:
            return (elapsed - self._timing.offset) / self._timing.scale
        return (elapsed - self._started - self._timing.offset) / self._timing.scale + self._head_start

    def _rest(self, s: float, dt: float) -> float:
        """What the step has left beyond the end of the trajectory [m]."""
        if self._timing is None:
            return max(0.0, s - self._layout.length)
        return max(0.0, self._clock(dt) - self._layout.end_time) * self._timing.scale * self.actor.motion.speed

    def _pose(self, s: float) -> Pose:
        pose = self._layout.at(s)
        return pose.turned(math.pi) if self._backwards and not self._layout.given else pose

    def _ask_driver(self) -> Status:
        count = max(2, math.ceil(self._layout.length / 2.0) + 1)
        points = np.array([self._layout.at(s)[:3] for s in np.linspace(self._s, self._layout.length, count).tolist()])
        goal = self.actor.goal
        self.actor.goal = replace(goal or Goal(), path=points, lap=None)
        here = self.actor.motion.pose
        return Status.SUCCESS if math.hypot(points[-1, 0] - here.x, points[-1, 1] - here.y) < 2.0 else Status.RUNNING

    def _resolved(self, position: model.Position) -> Pose:
        return resolve(position, self.stage, self.actor.name).pose

    def _found(self) -> model.Trajectory:
        if self.action.trajectory is not None:
            return self.action.trajectory
        reference = self.action.catalog_reference
        if self.action.trajectory_ref is not None:
            if self.action.trajectory_ref.trajectory is not None:
                return self.action.trajectory_ref.trajectory
            reference = self.action.trajectory_ref.catalog_reference
        return self.stage.catalog_entry(reference, model.Trajectory, self.action)

    def describe(self) -> str:
        """Which one."""
        timing = "at its own speed" if self._timing is None else "by its times"
        return f"follow trajectory {self._trajectory.name} {timing}"
