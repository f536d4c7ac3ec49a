"""Smallest gap and time to collision between one actor and all others; times until moving boxes touch."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from eidrive_scenario.base.arrays import Bools
from eidrive_scenario.base.geometry import box_distance
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.world.view import WorldView


def time_to_contact(a: Sequence[float], b: Sequence[float], velocity: Sequence[float]) -> float:
    """Return the time until two boxes (7,) with constant headings touch [s]; `velocity` (3,) of `b` relative to `a`
    [m/s].

    The result is 0 if they overlap, and infinite if they never touch. Swept separating axes: the projections on each
    axis overlap during one interval. The boxes touch when the last interval begins, if no interval has ended before
    (Ericson, Real-Time Collision Detection, 2005, section 5.5.8, for upright boxes).
    """
    dx, dy, vx, vy = b[0] - a[0], b[1] - a[1], velocity[0], velocity[1]
    enter, leave = _overlap_time(b[2] - a[2], a[5] / 2 + b[5] / 2, velocity[2])
    ca, sa, cb, sb = math.cos(a[6]), math.sin(a[6]), math.cos(b[6]), math.sin(b[6])
    for x, y in ((ca, sa), (-sa, ca), (cb, sb), (-sb, cb)):
        if enter > leave:
            return math.inf
        # Both are `half_projection`, with the same sines and cosines for all axes
        half_a = (abs(ca * x + sa * y) * a[3] + abs(ca * y - sa * x) * a[4]) / 2
        half_b = (abs(cb * x + sb * y) * b[3] + abs(cb * y - sb * x) * b[4]) / 2
        first, last = _overlap_time(x * dx + y * dy, half_a + half_b, x * vx + y * vy)
        if first > enter:
            enter = first
        if last < leave:
            leave = last
    return enter if enter <= leave else math.inf


def _overlap_time(gap: float, reach: float, rate: float) -> tuple[float, float]:
    """Return the interval, not before 0, in which a gap that changes at this rate is within the reach [s]."""
    if abs(rate) <= EPSILON:  # the speed of a vehicle that has stopped decays to denormal numbers
        return (0.0, math.inf) if abs(gap) <= reach else (math.inf, 0.0)
    first, last = (-reach - gap) / rate, (reach - gap) / rate
    if first > last:
        first, last = last, first
    return (first if first > 0.0 else 0.0), last


def separating_axes(a: Sequence[float], b: Sequence[float]) -> list[tuple[float, float, float]]:
    """Return the separating axes of two upright boxes."""
    axes = [(0.0, 0.0, 1.0)]
    for yaw in (a[6], b[6]):
        cos, sin = math.cos(yaw), math.sin(yaw)
        axes += [(cos, sin, 0.0), (-sin, cos, 0.0)]
    return axes


def half_projection(box: Sequence[float], x: float, y: float, z: float) -> float:
    """Return half the length of the projection of a box on an axis [m]."""
    cos, sin = math.cos(box[6]), math.sin(box[6])
    return (abs(cos * x + sin * y) * box[3] + abs(cos * y - sin * x) * box[4] + abs(z) * box[5]) / 2


STANDING = 0.1
"""Maximum speed of a standing actor [m/s]."""


def nearest_body(view: WorldView, name: str, attached: Collection[str] = ()) -> tuple[float, str]:
    """Return the distance between the boxes of an actor and of the nearest other one [m], and its name.

    attached  actors that are ignored: the other bodies of the road train

    Infinite and an empty name if the actor is alone. Boxes that are not finite are ignored.
    """
    own, boxes = view.row(name), view.boxes
    finite: Bools = np.logical_and.reduce(np.isfinite(boxes), axis=1)
    if not finite[own]:
        return math.inf, ""
    boxes = np.where(finite[:, None], boxes, boxes[own])
    centers = np.hypot(boxes[:, 0] - boxes[own, 0], boxes[:, 1] - boxes[own, 1])
    least = centers - np.hypot(boxes[:, 3], boxes[:, 4]) / 2.0
    least[~finite] = least[own] = math.inf
    for other in attached:
        least[view.row(other)] = math.inf
    box, best, nearest = boxes[own], math.inf, ""
    # The circles around boxes give a lower bound of their distance.
    reach = _radius(box)
    for row in np.argsort(least, kind="stable").tolist():
        if least[row] - reach >= best or least[row] == math.inf:
            break
        gap = box_distance(box, boxes[row])
        if gap < best:
            best, nearest = gap, view.names[row]
    return best, nearest


def nearest_pair(
    view: WorldView, below: float, trailers: Mapping[str, str] = MappingProxyType({})
) -> tuple[float, str, str] | None:
    """Return the smallest distance between the boxes of a moving actor and another one [m], and their names.

    trailers  trailer of each towing vehicle, by name; these pairs are ignored

    None if no two boxes are nearer than `below` [m]. Boxes that touch, and boxes that are not finite are ignored.
    """
    boxes = view.boxes
    finite: Bools = np.logical_and.reduce(np.isfinite(boxes), axis=1)
    rows = finite.nonzero()[0]
    moving = (finite & (np.abs(view.speed) > STANDING)).nonzero()[0]
    radius = np.hypot(boxes[:, 3], boxes[:, 4]) / 2.0
    first, second = (grid.ravel() for grid in np.meshgrid(moving, rows, indexing="ij"))
    centers = np.hypot(boxes[first, 0] - boxes[second, 0], boxes[first, 1] - boxes[second, 1])
    least = np.where(first == second, math.inf, centers - radius[first] - radius[second])
    nearest: tuple[float, str, str] | None = None
    near = (least < below).nonzero()[0]
    for index in near[np.argsort(least[near], kind="stable")].tolist():
        if least[index] >= below:
            break
        name, other = view.names[first[index]], view.names[second[index]]
        if trailers.get(name) == other or trailers.get(other) == name:
            continue
        gap = box_distance(boxes[first[index]], boxes[second[index]])
        if 0.0 < gap < below:
            below, nearest = gap, (gap, name, other)
    return nearest


def min_time_to_collision(view: WorldView, name: str, limit: float, attached: Collection[str] = ()) -> float:
    """Return the smallest time until the box of an actor touches that of another [s]; infinite above the limit [s].

    attached  actors that are ignored: the other bodies of the road train

    Velocities and headings are constant: the definition of the criterion `time_to_collision`.
    """
    own = view.row(name)
    boxes, states = view.plain_boxes, view.states
    box, state = boxes[own], states[own]
    smallest = math.inf
    for row, (other, moving) in enumerate(zip(boxes, states, strict=True)):
        velocity = (
            moving.velocity_x - state.velocity_x,
            moving.velocity_y - state.velocity_y,
            moving.velocity_z - state.velocity_z,
        )
        if row == own or (attached and view.names[row] in attached):
            continue
        # Circles around both boxes touch before the boxes.
        gap = math.hypot(other[0] - box[0], other[1] - box[1]) - _radius(box) - _radius(other)
        if gap <= math.hypot(velocity[0], velocity[1]) * limit:
            smallest = min(smallest, time_to_contact(box, other, velocity))
    return smallest if smallest <= limit else math.inf


def _radius(box: Sequence[float]) -> float:
    """Return the radius of the circle around a box [m]."""
    return math.hypot(box[3], box[4]) / 2.0
