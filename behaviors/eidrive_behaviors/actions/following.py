"""The following mode `follow`: as near to what an action asks for as the vehicle's limits let it come.

`position` takes an action at its word, whatever the vehicle could do. With `follow` a vehicle keeps to its Performance
and to the largest angle of its front wheels; where what is asked for lies within these, both modes are the same.
Pedestrians and things have no such limits and always do as they are told.
"""

from __future__ import annotations

import math

from eidrive_scenario.api.actions import TrajectoryCurve, model, turning_wheelbase
from eidrive_scenario.api.common import Pose, wrap_angle

TINY = 1e-9
ON_PATH = 1e-3
"""A vehicle that is this near to its trajectory is on it [m]."""
PREVIEW = 0.5
"""How far ahead a vehicle off its trajectory looks for it [s]."""


class RateLimitedValue:
    """A value that follows a moving one: its rate is bounded, and so is the rate's own rate of change.

    It closes in as fast as the bound still lets it settle: the time-optimal control of a double integrator (A. Bryson,
    Y. Ho: Applied Optimal Control, 3.9).

    up, down         bounds on how fast the rate grows and falls
    lowest, highest  bounds on the rate
    """

    def __init__(
        self, value: float, rate: float, *, up: float, down: float, lowest: float = -math.inf, highest: float = math.inf
    ) -> None:
        self.value, self.rate = value, rate
        self.up, self.down = up, down
        self.lowest, self.highest = lowest, highest
        self._wanted = value

    def keep(self, value: float, dt: float) -> None:
        """The value dt later is this one, as is the one that it follows, whatever the bounds."""
        self.rate = (value - self.value) / dt
        self.value = self._wanted = value

    def advance(self, wanted: float, dt: float) -> float:
        """The value dt later, when the other one will be at `wanted`."""
        moves = (wanted - self._wanted) / dt
        self._wanted = wanted
        exact = (wanted - self.value) / dt
        low, high = max(self.rate - self.down * dt, self.lowest), min(self.rate + self.up * dt, self.highest)
        settles = -self.down * dt - TINY <= moves - exact <= self.up * dt + TINY
        if low - TINY <= exact <= high + TINY and settles:
            self.value, self.rate = wanted, exact
            return wanted
        gap = (exact - moves) * dt
        closing = closing_rate(abs(gap), self.down if gap > 0.0 else self.up, dt)
        self.rate = min(max(moves + math.copysign(closing, gap), low), high)
        self.value += self.rate * dt
        return self.value


def closing_rate(gap: float, bound: float, dt: float) -> float:
    """The largest rate from which a gap is closed without overshoot, in steps of dt from each of which to the next it
    falls by bound · dt.

    In n steps it closes n · rate · dt less n (n - 1) / 2 · bound · dt²; for short steps that is √(2 · bound · gap).
    """
    if bound <= 0.0 or not math.isfinite(bound):
        return gap / dt
    steps = max(1, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * gap / (bound * dt * dt)) - 1.0) - TINY))
    return gap / (steps * dt) + 0.5 * (steps - 1) * bound * dt


class PathPursuit:
    """A vehicle on its way along a trajectory: on it where its wheels can turn so far, else after it.

    Off the trajectory it steers for a point of it ahead, turning about its rear axle (pure pursuit; R. Coulter,
    CMU-RI-TR-92-01, 1992).

    s, pose    arc length that is passed [m], and where the reference point is
    curvature  the largest that the wheels allow [1/m]
    on_path    whether it is on the trajectory
    """

    def __init__(self, layout: TrajectoryCurve, s: float, pose: Pose, curvature: float, wheelbase: float) -> None:
        self.s, self.pose = s, pose
        self._layout, self._curvature, self._wheelbase = layout, curvature, wheelbase
        start = layout.at(s)
        self.on_path = math.hypot(start.x - pose.x, start.y - pose.y) < ON_PATH

    def advance(self, ds: float, dt: float, *, tail_first: bool = False) -> Pose:
        """Return the pose after `ds` meters of the trajectory (back where negative), driven within dt.

        With `tail_first` the vehicle looks against the trajectory.
        """
        way, sense = abs(ds), math.copysign(1.0, ds)
        goal = self._goal(self.s + ds, tail_first)
        if self.on_path and abs(wrap_angle(goal.h - self.pose.h)) <= self._curvature * way + TINY:
            self.s += ds
            self.pose = goal
            return goal
        self.on_path = False
        back = math.pi if (sense < 0.0) != tail_first else 0.0
        x, y, _, h, _, _ = self.pose
        h += back
        curvature = self._towards(self._layout.extended(self.s + sense * max(self._wheelbase, PREVIEW * way / dt)), h)
        middle, h = h + 0.5 * curvature * way, wrap_angle(h + curvature * way)
        x, y = x + way * math.cos(middle), y + way * math.sin(middle)
        h = wrap_angle(h - back)
        self.s = self._beside(x, y, ds)
        goal = self._goal(self.s, tail_first)
        near = math.hypot(goal.x - x, goal.y - y) < ON_PATH
        self.on_path = near and abs(wrap_angle(goal.h - h)) <= self._curvature * way
        self.pose = goal if self.on_path else Pose(x, y, goal.z, h, goal.p, goal.r)
        return self.pose

    def put(self, s: float, pose: Pose) -> None:
        """Put the vehicle on the trajectory."""
        self.s, self.pose, self.on_path = s, pose, True

    def _goal(self, s: float, tail_first: bool) -> Pose:
        pose = self._layout.extended(s)
        if not tail_first:
            return pose
        back = pose.turned(math.pi)
        return back._replace(h=wrap_angle(back.h))

    def _towards(self, point: Pose, h: float) -> float:
        """Curvature of the arc to a point, for a vehicle that moves in the direction `h` [1/m]."""
        dx, dy = point.x - self.pose.x, point.y - self.pose.y
        ahead = math.cos(h) * dx + math.sin(h) * dy
        left = math.cos(h) * dy - math.sin(h) * dx
        if ahead <= 0.0:
            return math.copysign(self._curvature, left)
        return min(max(2.0 * left / (dx * dx + dy * dy), -self._curvature), self._curvature)

    def _beside(self, x: float, y: float, ds: float) -> float:
        """The arc length of the point of the trajectory beside a place; it does not go back."""
        s, low, high = self.s + ds, min(self.s, self.s + 2.0 * ds), max(self.s, self.s + 2.0 * ds)
        for _ in range(3):
            goal, tangent = self._layout.extended(s), self._layout.tangent(s)
            s += math.cos(tangent) * (x - goal.x) + math.sin(tangent) * (y - goal.y)
            s = min(max(s, low), high)
        return s


def follows(dynamics: model.TransitionDynamics) -> bool:
    """Whether a transition is to be followed as far as the vehicle can."""
    return dynamics.following_mode is model.FollowingMode.FOLLOW


def largest_curvature(vehicle: model.Vehicle) -> float:
    """Of a path of the rear axle [1/m], with the front wheels turned as far as they go; inf if nothing says it."""
    wheelbase = turning_wheelbase(vehicle) if vehicle.axles.additional_axle else wheelbase_of(vehicle)
    front = vehicle.axles.front_axle
    steering = abs(front.max_steering) if front is not None else 0.0
    return math.tan(min(steering, 1.5)) / wheelbase if wheelbase > 0.0 and steering > 0.0 else math.inf


def wheelbase_of(vehicle: model.Vehicle) -> float:
    """From the rear axle to the front axle [m]; 0 without a front axle."""
    front = vehicle.axles.front_axle
    return front.position_x - vehicle.axles.rear_axle.position_x if front is not None else 0.0


def speed_limiter(vehicle: model.Vehicle, speed: float, *, backwards: bool) -> RateLimitedValue:
    """Follows a speed [m/s] within the acceleration and, where the vehicle states it, the jerk of its Performance."""
    limits = vehicle.performance
    gain, loss = limits.max_acceleration, limits.max_deceleration
    gain_rate = math.inf if limits.max_acceleration_rate is None else limits.max_acceleration_rate
    loss_rate = math.inf if limits.max_deceleration_rate is None else limits.max_deceleration_rate
    if backwards:
        return RateLimitedValue(speed, 0.0, up=loss_rate, down=gain_rate, lowest=-gain, highest=loss)
    return RateLimitedValue(speed, 0.0, up=gain_rate, down=loss_rate, lowest=-loss, highest=gain)
