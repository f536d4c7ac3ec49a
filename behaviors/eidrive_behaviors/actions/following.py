"""Following mode `follow`: motion as close to the requested one as the limits of the vehicle allow.

`position` realizes a request exactly, regardless of the vehicle. With `follow` a vehicle respects its Performance and
the maximum angle of its front wheels. If the request is within these limits, both modes are equal. Pedestrians and
objects have no such limits and always realize the request.

Other requirements of actions are checked here, too: reference entities, and effects on driven vehicles.
"""

from __future__ import annotations

import math
from bisect import bisect_right

from eidrive_scenario.api.actions import ActionBehaviour, EntityAbsentError, TrajectoryCurve, model, turning_wheelbase
from eidrive_scenario.api.common import EPSILON, Pose, wrap_angle


def warn_without_effect(behaviour: ActionBehaviour) -> None:
    """Add a warning to the result: the driving stack of the actor has no goal for the action."""
    what = f"no effect on {behaviour.actor.name!r}, which a driving stack drives"
    behaviour.warn(what, "command its speed, route, lane or trajectory")


def warn_of_reverse(behaviour: ActionBehaviour, speed: float) -> None:
    """Add a warning to the result if a target speed is negative [m/s]: driving stacks plan forward motion only."""
    if speed < 0.0:
        what = f"{behaviour.actor.name!r} stops instead of reversing: a driving stack drives forwards only"
        behaviour.warn(what, "drive it in reverse by the storyboard, without a driving stack")


def warn_of_missed_end(behaviour: ActionBehaviour) -> None:
    """Add a warning to the result: the actor has passed the end of its trajectory at a distance."""
    what = f"the action does not end: {behaviour.actor.name!r} passes the end of the trajectory at a distance"
    behaviour.warn(what, "start before the trajectory, as driving stacks do not turn around")


def check_other_entity(behaviour: ActionBehaviour, name: str) -> None:
    """Raise ScenarioError if the reference entity of an action is its own actor."""
    if name == behaviour.actor_name:
        raise behaviour.error(f"the reference entity is the actor itself (got {name!r}; expected another entity)")


def check_presence(behaviour: ActionBehaviour, name: str) -> None:
    """Raise EntityAbsentError if the reference entity of an action is absent during the run.

    In Init it may have a speed before it has a position.
    """
    context = behaviour.context
    if context.dt > 0.0 and not context.actors[name].present and name not in context.view:
        raise EntityAbsentError(name)


TINY = 1e-9
ON_PATH = 1e-3
"""Maximum distance to the trajectory at which a vehicle counts as on it [m]."""
PREVIEW = 0.5
"""Preview time of a vehicle that is off its trajectory [s]."""
SEARCH_STEP = 1.0
"""Maximum step over several segments of the search for the place of a vehicle along its trajectory [m]."""


class RateLimitedValue:
    """Value that follows a moving target with bounded rate and bounded change of the rate.

    It approaches the target as fast as the bounds allow without overshoot: the time-optimal control of a double
    integrator (A. Bryson, Y. Ho: Applied Optimal Control, 3.9).

    up, down         bounds on the growth and the fall of the rate
    lowest, highest  bounds on the rate
    """

    def __init__(
        self, value: float, rate: float, *, up: float, down: float, lowest: float = -math.inf, highest: float = math.inf
    ) -> None:
        self.value, self.rate = value, rate
        self.up, self.down = up, down
        self.lowest, self.highest = lowest, highest
        self._target = value

    @property
    def has_finite_bounds(self) -> bool:
        """Whether the change of the rate is limited."""
        return math.isfinite(min(self.up, self.down))

    def keep(self, value: float, dt: float) -> None:
        """Set value and target of the time dt later, regardless of the bounds."""
        self.rate = (value - self.value) / dt
        self.value = self._target = value

    def advance(self, wanted: float, dt: float, final: float | None = None, *, moves: bool = False) -> float:
        """Return the value dt later, with the target at `wanted` by then.

        The target moves on to `final` and stops there, so that the value does not pass it. Without `final` the target
        keeps its rate. The motion of a target is followed exactly while the bounds allow that; with
        `moves`, as it may move on from `final`, also where the value could not stop there.
        """
        target_rate = (wanted - self._target) / dt
        self._target = wanted
        exact = (wanted - self.value) / dt
        low, high = max(self.rate - self.down * dt, self.lowest), min(self.rate + self.up * dt, self.highest)
        least, most = self._stopping_rates(final, dt)
        settles = -self.down * dt - TINY <= target_rate - exact <= self.up * dt + TINY
        stops = moves or least - TINY <= exact <= most + TINY
        if low - TINY <= exact <= high + TINY and settles and stops:
            self.value, self.rate = wanted, exact
            return wanted
        gap = (exact - target_rate) * dt
        closing = closing_rate(abs(gap), self.down if gap > 0.0 else self.up, dt)
        rate = min(max(target_rate + math.copysign(closing, gap), least), most)
        self.rate = min(max(rate, low), high)
        self.value += self.rate * dt
        return self.value

    def _stopping_rates(self, final: float | None, dt: float) -> tuple[float, float]:
        """Return the bounds on the rate within which the value can stop at `final`."""
        if final is None:
            return -math.inf, math.inf
        rest = final - self.value
        if rest > 0.0:
            return -math.inf, closing_rate(rest, self.down, dt)
        return -closing_rate(-rest, self.up, dt), math.inf

    def rests_at(self, final: float, dt: float) -> bool:
        """True if the value is at `final` and its rate can be 0 in the next step."""
        return abs(self.value - final) < EPSILON and -self.up * dt - TINY <= self.rate <= self.down * dt + TINY


def closing_rate(gap: float, bound: float, dt: float) -> float:
    """Return the maximum rate from which a gap closes without overshoot.

    The rate falls by bound · dt from each step of dt to the next. In n steps it closes n · rate · dt - n (n - 1) / 2 ·
    bound · dt²; for short steps that is √(2 · bound · gap).
    """
    if bound <= 0.0 or not math.isfinite(bound):
        return gap / dt
    steps = max(1, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * gap / (bound * dt * dt)) - 1.0) - TINY))
    return gap / (steps * dt) + 0.5 * (steps - 1) * bound * dt


class PathPursuit:
    """Motion of a vehicle along a trajectory: on it while the wheels can turn far enough, else by pursuit.

    Off the trajectory the vehicle steers toward a preview point on it and turns about its rear axle (pure pursuit; R.
    Coulter, CMU-RI-TR-92-01, 1992). Until it has joined the trajectory it cannot pass its end from afar.

    s, pose    covered arc length [m], and pose of the reference point
    curvature  maximum curvature that the wheels allow [1/m]
    on_path    whether the vehicle is on the trajectory
    """

    def __init__(self, layout: TrajectoryCurve, s: float, pose: Pose, curvature: float, wheelbase: float) -> None:
        self.s, self.pose = s, pose
        self._layout, self._curvature, self._wheelbase = layout, curvature, wheelbase
        self.on_path = _distance(layout.at(s), pose.x, pose.y) < ON_PATH
        if not self.on_path and not layout.closed:
            self.s = self._beside(pose.x, pose.y)
        self._has_joined = self.on_path

    def advance(self, ds: float, dt: float, *, tail_first: bool = False) -> Pose:
        """Return the pose after `ds` meters of the trajectory (backwards if negative), driven within dt.

        With `tail_first` the vehicle faces against the trajectory.
        """
        way, sense = abs(ds), math.copysign(1.0, ds)
        if way == 0.0:
            return self.pose
        goal, sharpest = self._goal(self.s + ds, tail_first), min(self._curvature, math.pi / way)
        if self.on_path and abs(wrap_angle(goal.h - self.pose.h)) <= sharpest * way + TINY:
            self.s += ds
            self.pose = goal
            return goal
        self.on_path = False
        back = math.pi if (sense < 0.0) != tail_first else 0.0
        x, y, _, h, _, _ = self.pose
        h += back
        preview = max(self._wheelbase, PREVIEW * way / dt)
        near = max(preview, 2.0 / sharpest)
        self._has_joined = self._has_joined or _distance(self._layout.at(self.s), x, y) <= near
        curvature = self._curvature_to(self._layout.extended(self.s + sense * preview), h, sharpest)
        middle, h = h + 0.5 * curvature * way, wrap_angle(h + curvature * way)
        x, y = x + way * math.cos(middle), y + way * math.sin(middle)
        h = wrap_angle(h - back)
        if self._has_joined or not self._is_beyond_end(x, y, near):
            self.s = self._project(x, y, ds)
        goal = self._goal(self.s, tail_first)
        self.on_path = _distance(goal, x, y) < ON_PATH and abs(wrap_angle(goal.h - h)) <= sharpest * way
        self.pose = goal if self.on_path else Pose(x, y, goal.z, h, goal.p, goal.r)
        return self.pose

    def put(self, s: float, pose: Pose) -> None:
        """Set the vehicle onto the trajectory."""
        self.s, self.pose, self.on_path, self._has_joined = s, pose, True, True

    def _goal(self, s: float, tail_first: bool) -> Pose:
        pose = self._layout.extended(s)
        if not tail_first:
            return pose
        back = pose.turned(math.pi)
        return back._replace(h=wrap_angle(back.h))

    def _curvature_to(self, point: Pose, h: float, sharpest: float) -> float:
        """Return the curvature of the arc to a point for a vehicle that moves in direction `h` [1/m]; at most
        `sharpest`."""
        dx, dy = point.x - self.pose.x, point.y - self.pose.y
        ahead = math.cos(h) * dx + math.sin(h) * dy
        left = math.cos(h) * dy - math.sin(h) * dx
        if ahead <= 0.0:
            return math.copysign(sharpest, left)
        return min(max(2.0 * left / (dx * dx + dy * dy), -sharpest), sharpest)

    def _beside(self, x: float, y: float) -> float:
        """Return the first arc length from `s` on at which the trajectory is beside a position [m].

        It is `s` itself for a position that is not ahead of it, and for one beyond the end.
        """
        layout, s = self._layout, self.s
        while s < layout.length:
            point, tangent = layout.at(s), layout.tangent(s)
            ahead = math.cos(tangent) * (x - point.x) + math.sin(tangent) * (y - point.y)
            if ahead <= ON_PATH:
                return s
            # A straight segment ends, or is beside the position, in one step
            s += min(ahead, max(SEARCH_STEP, layout.s[bisect_right(layout.s, s)] - s))
        return self.s

    def _is_beyond_end(self, x: float, y: float, near: float) -> bool:
        """Return True for a position beyond the end of an open trajectory, and farther than `near` [m] from the end.

        The end is within reach if it is nearer than the preview point or the diameter of the turning circle, as no
        steering angle leads to a point inside this circle.
        """
        layout = self._layout
        if layout.closed or _distance(layout.at(layout.length), x, y) <= near:
            return False
        return layout.project(x, y)[0] >= layout.length

    def _project(self, x: float, y: float, ds: float) -> float:
        """Return the arc length of the point of the trajectory nearest to a position [m].

        It never moves against `ds`.
        """
        s, low, high = self.s + ds, min(self.s, self.s + 2.0 * ds), max(self.s, self.s + 2.0 * ds)
        for _ in range(3):
            goal, tangent = self._layout.extended(s), self._layout.tangent(s)
            s += math.cos(tangent) * (x - goal.x) + math.sin(tangent) * (y - goal.y)
            s = min(max(s, low), high)
        return s


def _distance(pose: Pose, x: float, y: float) -> float:
    """Return the horizontal distance of a position from a pose [m]."""
    return math.hypot(pose.x - x, pose.y - y)


class DelayWarning:
    """Warning that a limit delays a motion beyond the extent that the file requests; at most one per action.

    A repeated action starts from other states, so that its later delays differ in their numbers only.
    """

    def __init__(self, behaviour: ActionBehaviour) -> None:
        self._behaviour: ActionBehaviour | None = behaviour

    def add(self, late: str, limit: str) -> None:
        """Add the warning to the result of the run, with the delay and the limit that causes it."""
        behaviour, self._behaviour = self._behaviour, None
        if behaviour is not None:
            behaviour.warn(f"{late}: {limit}", "allow more time or distance, or change the limit")


def is_follow_mode(dynamics: model.TransitionDynamics) -> bool:
    """True if a transition has the following mode `follow`."""
    return dynamics.following_mode is model.FollowingMode.FOLLOW


def largest_curvature(vehicle: model.Vehicle) -> float:
    """Return the maximum curvature of the path of the rear axle [1/m].

    The front wheels are at their maximum angle. Without steering or wheelbase the result is infinite.
    """
    wheelbase = turning_wheelbase(vehicle) if vehicle.axles.additional_axle else wheelbase_of(vehicle)
    front = vehicle.axles.front_axle
    steering = abs(front.max_steering) if front is not None else 0.0
    return math.tan(min(steering, 1.5)) / wheelbase if wheelbase > 0.0 and steering > 0.0 else math.inf


def wheelbase_of(vehicle: model.Vehicle) -> float:
    """Return the distance from the rear axle to the front axle [m]; 0 without a front axle."""
    front = vehicle.axles.front_axle
    return front.position_x - vehicle.axles.rear_axle.position_x if front is not None else 0.0


def speed_limiter(vehicle: model.Vehicle, speed: float, *, backwards: bool) -> RateLimitedValue:
    """Return a speed [m/s] that is limited by the acceleration and, if specified, the jerk of the Performance."""
    limits = vehicle.performance
    gain, loss = limits.max_acceleration, limits.max_deceleration
    gain_rate = math.inf if limits.max_acceleration_rate is None else limits.max_acceleration_rate
    loss_rate = math.inf if limits.max_deceleration_rate is None else limits.max_deceleration_rate
    if backwards:
        return RateLimitedValue(speed, 0.0, up=loss_rate, down=gain_rate, lowest=-gain, highest=loss)
    return RateLimitedValue(speed, 0.0, up=gain_rate, down=loss_rate, lowest=-loss, highest=gain)
