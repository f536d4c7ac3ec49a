"""Courses of connecting roads: lines, clothoids and arcs between two poses."""

from __future__ import annotations

import math

from eidrive_scenario.roads.model import curves
from xosc.roads.layout import Piece, Way, trace

CLOTHOID = math.radians(25.0)
"""Part of a quarter turn that each of the two clothoids covers [rad]; in proportion for other turns."""


def course(way: Way) -> tuple[curves.Curve, ...]:
    """Return the center line of the first lane of a connecting road."""
    if way.line is not None:
        return way.line
    start, end = way.start.mouth(way.lanes[0][0]), way.end.mouth(way.lanes[0][1])
    return connect(*start, way.start.inward, *end, way.end.outward)


def connect(x: float, y: float, heading: float, x_end: float, y_end: float, end: float) -> tuple[curves.Curve, ...]:
    """Return a line of continuous curvature between two poses: one turn, or two opposite ones if they are parallel.

    Raise ValueError if the poses require another form.
    """
    along = math.cos(heading) * (x_end - x) + math.sin(heading) * (y_end - y)
    across = math.cos(heading) * (y_end - y) - math.sin(heading) * (x_end - x)
    angle = math.remainder(end - heading, 2.0 * math.pi)
    if abs(angle) < 1e-9:
        return trace(x, y, heading, _shift(along, across))
    if abs(abs(angle) - math.pi / 2) < 1e-12:
        angle, before, after = math.copysign(math.pi / 2, angle), along, math.copysign(across, across * angle)
    else:
        before, after = along - across / math.tan(angle), across / math.sin(angle)
    tangent = min(before, after)
    if tangent <= 0.0:
        raise ValueError(f"no single turn by {math.degrees(angle):.1f}° leads {along:.2f} m ahead, {across:.2f} m left")
    return trace(x, y, heading, (Piece(before - tangent), *_turn(angle, tangent), Piece(after - tangent)))


def _shift(along: float, across: float) -> tuple[Piece, ...]:
    """Return a line to a parallel pose: straight, or with two opposite turns."""
    if along <= 0.0:
        raise ValueError(f"the end is {-along:.2f} m behind the start")
    if abs(across) < 1e-9:
        return (Piece(along),)
    angle = 2.0 * math.atan2(across, along)
    tangent = along / (2.0 * (1.0 + math.cos(angle)))
    return (*_turn(angle, tangent), *_turn(-angle, tangent))


def _turn(angle: float, tangent: float) -> tuple[Piece, ...]:
    """Return a clothoid, an arc and a clothoid that turn by an angle and use `tangent` [m] of both straight lines."""
    turn = abs(angle)
    spiral_length = 2.0 * CLOTHOID * turn / (math.pi / 2)
    arc_length = turn - spiral_length
    x, y, h = 0.0, 0.0, 0.0
    for start, end, length in ((0.0, 1.0, spiral_length), (1.0, 1.0, arc_length), (1.0, 0.0, spiral_length)):
        x, y, h, *_ = curves.spiral(0.0, x, y, h, length, start, end).at(length)
    radius = tangent * (1.0 + math.cos(turn)) / x
    curvature = math.copysign(1.0 / radius, angle)
    return (
        Piece(spiral_length * radius, 0.0, curvature),
        Piece(arc_length * radius, curvature),
        Piece(spiral_length * radius, curvature, 0.0),
    )
