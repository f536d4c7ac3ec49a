"""Control: from a plan to pedals and steering, with one regulator along the path and one across."""

from __future__ import annotations

import math

from eidrive_scenario.driving.control.pid import PID, Gains
from eidrive_scenario.driving.planning.path import LEADS_AWAY
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec, Control

LARGEST_ACCELERATION = 3.5
LARGEST_DECELERATION = 6.5
"""What the regulator asks for at most, as EI-Drive's planner [m/s²]; an emergency brake of the plan may exceed it."""
LONGITUDINAL = Gains(proportional=1.5, integral=0.2)
"""On the error of the speed [1/s]: time constant 2/3 s; the integral carries rolling resistance and drag, and learns
them near the target, where the error is at most"""
SPEED_BAND = 1.0
"""[m/s]"""
LATERAL = Gains(proportional=1.0, integral=0.1)
"""On the turn towards the path; the integral carries the slip of the tires in a curve."""
CROSS_TRACK_GAIN = 2.0
"""How fast an offset from the path decays [1/s]."""
LARGEST_APPROACH = 2.0
"""Of a large offset, the speed towards the path [m/s]: what tires and steering undo in time before the path."""
LEARNING = 0.1
"""Up to this turn towards the path the integral learns; beyond it, it would learn the way there [rad]."""
SOFTENING = 1.0
"""Keeps the steering calm near standstill [m/s]."""
STANDSTILL = 0.3
"""Below this speed a vehicle that is to stop holds its brake [m/s]."""
HOLDING = 3.0
"""Deceleration that the held brake would give: enough for a slope of 30 % [m/s²]."""


class VehicleController:
    """Follows the plans of one vehicle.

    Across the path, the law of Stanley (Hoffmann, Tomlin, Montemerlo, Thrun: Autonomous automobile trajectory tracking
    for off-road driving, ACC 2007): the front wheels point along the path, turned towards it by atan(k e / (v0 + v)),
    where k e is bounded: without that, what is far off its path or stands across it swings about it for ever.
    """

    def __init__(self, spec: ActorSpec, dt: float) -> None:
        self.spec = spec
        self._speed = PID(LONGITUDINAL, low=-LARGEST_DECELERATION, high=LARGEST_ACCELERATION, dt=dt, band=SPEED_BAND)
        self._direction = PID(LATERAL, low=-spec.max_steering, high=spec.max_steering, dt=dt, band=LEARNING)
        self._steering = 0.0

    def control(self, ego: EgoState, plan: Plan) -> Control:
        """Pedals and steering for the next step."""
        steering = self._steer(ego, plan)
        if plan.braking is not None:
            self._speed.reset()
            return Control(0.0, _pedal(plan.braking, self.spec.max_deceleration), steering)
        return self._pedals(self._accelerate(ego, plan), steering)

    def hold_standstill(self) -> Control:
        """The brake held, the wheels as they are."""
        return Control(0.0, 1.0, self._steering)

    def _accelerate(self, ego: EgoState, plan: Plan) -> float:
        """The acceleration to ask for [m/s²]; a falling profile of speeds is met by its own deceleration."""
        target, falling = _speed_here(ego, plan)
        if target < STANDSTILL and ego.speed < STANDSTILL:
            self._speed.reset()
            return -HOLDING
        return self._speed.update(target - ego.speed, falling or plan.acceleration)

    def _pedals(self, acceleration: float, steering: float) -> Control:
        if acceleration >= 0.0:
            return Control(_pedal(acceleration, self.spec.max_acceleration), 0.0, steering)
        return Control(0.0, _pedal(-acceleration, self.spec.max_deceleration), steering)

    def _steer(self, ego: EgoState, plan: Plan) -> float:
        x = float(ego.position[0]) + self.spec.wheelbase * math.cos(ego.yaw)
        y = float(ego.position[1]) + self.spec.wheelbase * math.sin(ego.yaw)
        heading, left = _nearest(plan.points[:12].tolist(), x, y)
        back = -CROSS_TRACK_GAIN * left
        if abs(back) > LARGEST_APPROACH:
            back = math.copysign(LARGEST_APPROACH, back)
        turn = math.atan2(back, SOFTENING + max(ego.speed, 0.0))
        self._steering = self._direction.update(turn, feed_forward=wrap_angle(heading - ego.yaw))
        return self._steering


def _pedal(wanted: float, most: float) -> float:
    """How far to press a pedal for an acceleration [m/s²], which gives `most` [m/s²] where it is pressed down."""
    return wanted / most if wanted < most else 1.0


def _speed_here(ego: EgoState, plan: Plan) -> tuple[float, float]:
    """The plan's speed where the vehicle is on its first segment [m/s], and its acceleration there, at most 0 [m/s²].

    A plan that slows down does so evenly: the square of the speed falls linearly with the way.
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
    """Heading of the path where it is nearest to a point [rad], and how far left of it the point lies [m].

    The heading turns evenly from one segment's middle to the next one's, so that the steering does not jump.
    """
    best, nearest, place, leads_away = 0, math.inf, 0.0, math.inf
    x0, y0 = points[0]
    for index, (x1, y1) in enumerate(points[1:]):
        dx, dy = x1 - x0, y1 - y0
        ax, ay = x - x0, y - y0
        share = (ax * dx + ay * dy) / (dx * dx + dy * dy)
        held = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        ax, ay = ax - held * dx, ay - held * dy
        gap = ax * ax + ay * ay
        if gap < nearest:
            root = math.sqrt(gap)
            best, nearest, place, leads_away = index, gap - 2e-9 * root, held, (root + LEADS_AWAY) ** 2
        elif gap > leads_away:
            break
        x0, y0 = x1, y1
    heading = _heading(points, best)
    (x0, y0), (x1, y1) = points[best], points[best + 1]
    left = ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / math.hypot(x1 - x0, y1 - y0)
    neighbor = best + 1 if place > 0.5 else best - 1
    if 0 <= neighbor < len(points) - 1:
        heading += abs(place - 0.5) * wrap_angle(_heading(points, neighbor) - heading)
    return heading, left


def _heading(points: list[list[float]], index: int) -> float:
    (x0, y0), (x1, y1) = points[index], points[index + 1]
    return math.atan2(y1 - y0, x1 - x0)
