"""Time until two boxes touch if both keep their longitudinal accelerations, and stand once they have stopped."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from eidrive_scenario.api.common import EPSILON, WorldView
from eidrive_scenario.api.criteria import half_projection, separating_axes

MAX_ACCELERATION = 15.0
"""Maximum longitudinal acceleration of a vehicle; a larger one is a step of a scripted speed and counts as 0 [m/s²]."""

Vector = tuple[float, float, float]


class Course(NamedTuple):
    """Straight course: velocity [m/s] and acceleration [m/s²] along it until `stop` [s], then standstill."""

    velocity: Vector
    acceleration: Vector
    stop: float


class _Phase(NamedTuple):
    """Relative motion on an axis from `start` [s]: position [m], speed [m/s] and acceleration [m/s²] at the start."""

    start: float
    end: float
    position: Vector
    velocity: Vector
    acceleration: Vector


def course(view: WorldView, row: int) -> Course:
    """Return the course of an actor with the acceleration along its velocity, or along its heading at standstill."""
    state = view.states[row]
    velocity = (state.velocity_x, state.velocity_y, state.velocity_z)
    speed = math.sqrt(sum(part * part for part in velocity))
    along = tuple(part / speed for part in velocity) if speed > 0.0 else (math.cos(state.yaw), math.sin(state.yaw), 0.0)
    rate = along[0] * state.acceleration_x + along[1] * state.acceleration_y + along[2] * state.acceleration_z
    if abs(rate) > MAX_ACCELERATION or (speed == 0.0 and rate < 0.0):
        rate = 0.0
    stop = speed / -rate if rate < 0.0 else math.inf
    return Course(velocity, (rate * along[0], rate * along[1], rate * along[2]), stop)


def accelerated_contact(a: Sequence[float], b: Sequence[float], first: Course, second: Course) -> float:
    """Return the time until two boxes (7,) on these courses touch [s]; 0 if they overlap, infinite if never.

    In each phase between the standstills, the projections on the separating axes are quadratic in time. They all
    overlap, or not, in the intervals between the times at which one of them begins or ends to overlap.
    """
    tests = [(axis, half_projection(a, *axis) + half_projection(b, *axis)) for axis in separating_axes(a, b)]
    gap = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    for phase in _phases(gap, first, second):
        events = {0.0, phase.end - phase.start}
        for axis, reach in tests:
            events.update(_crossings(*_on_axis(phase, axis), reach))
        times = sorted(time for time in events if 0.0 <= time <= phase.end - phase.start)
        for begin, end in pairwise(times):
            middle = begin + 1.0 if math.isinf(end) else (begin + end) / 2.0
            if all(abs(_value(*_on_axis(phase, axis), middle)) <= reach for axis, reach in tests):
                return phase.start + begin
    return math.inf


def _phases(gap: Vector, first: Course, second: Course) -> Iterator[_Phase]:
    """Yield the relative motion between the times at which one of the actors stops."""
    bounds = sorted({0.0, first.stop, second.stop, math.inf})
    for start, end in pairwise(bounds):
        near, far = _state(first, start), _state(second, start)
        yield _Phase(
            start,
            end,
            _combined(_combined(gap, far[0], 1.0), near[0], -1.0),
            _combined(far[1], near[1], -1.0),
            _combined(far[2], near[2], -1.0),
        )


def _state(way: Course, time: float) -> tuple[Vector, Vector, Vector]:
    """Return displacement, velocity and acceleration of a course from a time on."""
    until = min(time, way.stop)
    moved = tuple(v * until + a * until * until / 2.0 for v, a in zip(way.velocity, way.acceleration, strict=True))
    displacement = (moved[0], moved[1], moved[2])
    if time >= way.stop:
        return displacement, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return displacement, _combined(way.velocity, way.acceleration, time), way.acceleration


def _combined(first: Vector, second: Vector, factor: float) -> Vector:
    return first[0] + factor * second[0], first[1] + factor * second[1], first[2] + factor * second[2]


def _on_axis(phase: _Phase, axis: Vector) -> tuple[float, float, float]:
    """Return the coefficients of the relative position on an axis over the time since the start of the phase."""
    position, velocity, acceleration = (
        sum(part * way for part, way in zip(vector, axis, strict=True))
        for vector in (phase.position, phase.velocity, phase.acceleration)
    )
    # The speed of a vehicle that has stopped decays to denormal numbers
    velocity, acceleration = (rate if abs(rate) > EPSILON else 0.0 for rate in (velocity, acceleration))
    return position, velocity, acceleration / 2.0


def _value(constant: float, linear: float, quadratic: float, time: float) -> float:
    return constant + time * (linear + time * quadratic)


def _crossings(constant: float, linear: float, quadratic: float, reach: float) -> Iterator[float]:
    """Yield the times at which a quadratic has the value `reach` or its negative."""
    for level in (reach, -reach):
        offset = constant - level
        if quadratic == 0.0:
            if linear != 0.0:
                yield -offset / linear
            continue
        discriminant = linear * linear - 4.0 * quadratic * offset
        if discriminant >= 0.0:
            # The stable form of both roots: no difference of nearly equal numbers
            half = -(linear + math.copysign(math.sqrt(discriminant), linear)) / 2.0
            yield half / quadratic
            if half != 0.0:
                yield offset / half
