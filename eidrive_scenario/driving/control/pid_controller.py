"""PID vehicle controller: from a trajectory to throttle, brake and steering."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planning.path import nearest_segment
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.physics.vehicle_parameters import VehicleParameters


@dataclass(frozen=True)
class Gains:
    """Gains of the error, its integral [1/s] and its derivative [s]."""

    proportional: float
    integral: float = 0.0
    derivative: float = 0.0


class PID:
    """PID controller: output = kp·e + ki·∫e dt + kd·de/dt, within limits.

    Anti-windup by conditional integration: the integral is constant while the output is at a limit that the error
    exceeds further, and while the error is larger than `band`.
    """

    def __init__(self, gains: Gains, *, low: float, high: float, dt: float, band: float = math.inf) -> None:
        self.gains = gains
        self.low = low
        self.high = high
        self.dt = dt
        self.band = band
        self._integral = 0.0
        self._last: float | None = None

    def reset(self) -> None:
        """Reset integral and derivative."""
        self._integral = 0.0
        self._last = None

    def update(self, error: float, feed_forward: float = 0.0, *, learns: bool = True) -> float:
        """Return the output for the error of this tick plus a feed-forward part.

        learns  whether the integral may accumulate
        """
        gains = self.gains
        slope = 0.0 if self._last is None else (error - self._last) / self.dt
        self._last = error
        fixed = feed_forward + gains.proportional * error + gains.derivative * slope
        integral = self._integral + error * self.dt
        output = fixed + gains.integral * integral
        free = self.low < output < self.high or (output >= self.high) == (error < 0.0)
        if learns and free and abs(error) <= self.band:
            self._integral = integral
        return min(max(fixed + gains.integral * self._integral, self.low), self.high)


LARGEST_ACCELERATION = 3.5
LARGEST_DECELERATION = 6.5
"""Maximum acceleration and deceleration of the PID, as of the planner of EI-Drive [m/s²]; emergency braking of a plan
may exceed the latter."""
LONGITUDINAL = Gains(proportional=1.5, integral=0.2)
"""Gains of the speed error [1/s]: time constant 2/3 s. The integral compensates rolling resistance and drag."""
SPEED_BAND = 1.0
"""Maximum speed error at which the integral accumulates [m/s]."""
LATERAL = Gains(proportional=1.0, integral=0.1)
"""Gains of the turn towards the path; the integral compensates the slip of the tires in a curve."""
CROSS_TRACK_GAIN = 2.0
"""Decay rate of an offset from the path [1/s]."""
LARGEST_APPROACH = 2.0
"""Maximum speed towards the path at a large offset [m/s]. Tires and steering reverse this speed before the path."""
LEARNING = 0.1
"""Maximum turn towards the path at which the integral accumulates [rad]; beyond it the approach would be integrated."""
SOFTENING = 1.0
"""Softening constant of the Stanley law, for calm steering near standstill [m/s]."""
AT_REST = 0.1
"""Speed below which a vehicle stands [m/s]; a faster one approaches its path."""
STANDSTILL = 0.3
"""Speed below which a stopping vehicle holds its brake [m/s]."""
GRAVITY = 9.81
"""[m/s²]; the pedals compensate its part along a slope."""
HOLDING = 3.0
"""Deceleration that corresponds to the held brake: sufficient on a slope of 30 % [m/s²]."""


class PidController(VehicleController):
    """PID control of the speed, and lateral control by the Stanley law with an integral part.

    Source of the lateral law: Hoffmann, Tomlin, Montemerlo, Thrun, "Autonomous automobile trajectory tracking for
    off-road driving", ACC 2007. The front wheels point along the path, turned towards it by atan(k e / (v0 + v)). The
    product k e is bounded; otherwise a vehicle far from its path or across it oscillates about the path.
    """

    def __init__(self, spec: ActorSpec, dt: float) -> None:
        super().__init__(spec, dt)
        self._speed = PID(LONGITUDINAL, low=-LARGEST_DECELERATION, high=LARGEST_ACCELERATION, dt=dt, band=SPEED_BAND)
        self._direction = PID(LATERAL, low=-spec.max_steering, high=spec.max_steering, dt=dt, band=LEARNING)
        self._steering = 0.0
        self._rolling = VehicleParameters.of(spec).rolling_resistance * GRAVITY

    def control(self, ego: EgoState, plan: Plan) -> Control:
        """Return throttle, brake and steering of the next time step. The braking of a plan overrides its speeds."""
        steering = self._steer(ego, plan)
        if plan.braking is not None:
            self._speed.reset()
            braking = max(plan.braking + _downhill(ego), 0.0)
            return Control(0.0, _pedal(braking, self.spec.max_deceleration), steering)
        if plan.acceleration < 0.0:  # exact, unlike the profile between two points; the tires take their part
            target, fed_forward = float(plan.speeds[0]), plan.acceleration + self._rolling
        else:
            target, falling = _speed_here(ego, plan)
            fed_forward = falling or plan.acceleration
        if target < STANDSTILL and ego.speed < STANDSTILL:
            self._speed.reset()
            acceleration = -HOLDING
        else:
            acceleration = self._speed.update(target - ego.speed, fed_forward)
        acceleration -= _downhill(ego)
        if acceleration >= 0.0:
            return Control(_pedal(acceleration, self.spec.max_acceleration), 0.0, steering)
        return Control(0.0, _pedal(-acceleration, self.spec.max_deceleration), steering)

    def hold_standstill(self) -> Control:
        """Return full brake with the last steering angle."""
        return Control(0.0, 1.0, self._steering)

    def _steer(self, ego: EgoState, plan: Plan) -> float:
        x = float(ego.position[0]) + self.spec.wheelbase * math.cos(ego.yaw)
        y = float(ego.position[1]) + self.spec.wheelbase * math.sin(ego.yaw)
        heading, left = _nearest(plan.points[:12].tolist(), x, y)
        back = -CROSS_TRACK_GAIN * left
        if abs(back) > LARGEST_APPROACH:
            back = math.copysign(LARGEST_APPROACH, back)
        turn = math.atan2(back, SOFTENING + max(ego.speed, 0.0))
        # A vehicle that stands does not approach its path, whereas the integral would turn its wheels more and more.
        self._steering = self._direction.update(turn, wrap_angle(heading - ego.yaw), learns=ego.speed >= AT_REST)
        return self._steering


def _downhill(ego: EgoState) -> float:
    """Return the acceleration by the slope of the road [m/s²], positive downhill.

    The integral of the PID does not replace it: a plan that begins with the present speed has no speed error.
    """
    return GRAVITY * math.sin(ego.pitch)


def _pedal(acceleration: float, maximum: float) -> float:
    """Return the pedal position in [0, 1] for an acceleration; a fully pressed pedal gives `maximum` [m/s²]."""
    return acceleration / maximum if acceleration < maximum else 1.0


def _speed_here(ego: EgoState, plan: Plan) -> tuple[float, float]:
    """Return speed [m/s] and acceleration (at most 0) [m/s²] of the plan at the vehicle, on its first segment.

    The deceleration of a segment is constant: the square of the speed falls linearly with the distance.
    """
    here, ahead = plan.speeds[:2].tolist()
    if ahead >= here:
        return here, 0.0
    (x0, y0), (x1, y1) = plan.points[:2].tolist()
    square = (x1 - x0) ** 2 + (y1 - y0) ** 2
    x, y, _ = ego.position.tolist()
    share = min(max(((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / square, 0.0), 1.0)
    fall = ahead * ahead - here * here
    return math.sqrt(here * here + share * fall), fall / (2.0 * math.sqrt(square))


def _nearest(points: list[list[float]], x: float, y: float) -> tuple[float, float]:
    """Return the heading of the path at its nearest point [rad], and the signed offset of the point to the left [m].

    The heading is interpolated between the midpoints of segments, so that the steering is continuous.
    """
    segments = (
        (x0, y0, x1 - x0, y1 - y0, (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
        for (x0, y0), (x1, y1) in pairwise(points)
    )
    nearest, share = nearest_segment(segments, x, y)
    heading = _heading(points, nearest)
    (x0, y0), (x1, y1) = points[nearest], points[nearest + 1]
    left = ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / math.hypot(x1 - x0, y1 - y0)
    neighbor = nearest + 1 if share > 0.5 else nearest - 1
    if 0 <= neighbor < len(points) - 1:
        heading += abs(share - 0.5) * wrap_angle(_heading(points, neighbor) - heading)
    return heading, left


def _heading(points: list[list[float]], index: int) -> float:
    (x0, y0), (x1, y1) = points[index], points[index + 1]
    return math.atan2(y1 - y0, x1 - x0)
