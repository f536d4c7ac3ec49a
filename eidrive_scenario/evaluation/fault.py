"""Side and fault of a collision by the rules of nuPlan (metric `no_ego_at_fault_collisions`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from eidrive_scenario.base.geometry import points_in_polygon, points_of_boxes
from eidrive_scenario.evaluation.actor_tracking import LaneTracker, corners
from eidrive_scenario.roads.objects import crosswalks
from eidrive_scenario.world.view import ActorState, WorldView

STOPPED = 0.05
"""Maximum speed of a stopped actor [m/s]."""
BEHIND = math.radians(150.0)
"""Angle at the reference point between the direction of travel and the center of an actor beyond which that actor is
behind."""

BODY_GRID = np.array([(a, b, -1.0) for a in (-1.0, -0.5, 0.0, 0.5, 1.0) for b in (-1.0, 0.0, 1.0)])
"""Points of a body on the ground, as shares of its half sizes."""
CORNER = 0.1
"""Maximum distance of a contact at a corner from both faces [m]."""

Side = Literal["front", "rear", "left", "right"]


class Impact(NamedTuple):
    """Side of a body that was hit, whether its actor is at fault, and the rule that decides."""

    side: Side
    at_fault: bool
    rule: str


def side_of(body: Sequence[float], x: float, y: float, other: Sequence[float] | None = None) -> Side:
    """Return the face of a body (7,) that is nearest to a point of contact.

    At a corner the axis along which the body overlaps the `other` body (7,) less decides, as two faces are near there.
    """
    dx, dy = x - body[0], y - body[1]
    cos, sin = math.cos(body[6]), math.sin(body[6])
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    distances: dict[Side, float] = {
        "front": abs(body[3] / 2.0 - ahead),
        "rear": abs(body[3] / 2.0 + ahead),
        "left": abs(body[4] / 2.0 - left),
        "right": abs(body[4] / 2.0 + left),
    }
    end: Side = "front" if ahead >= 0.0 else "rear"
    flank: Side = "left" if left >= 0.0 else "right"
    if other is not None and max(distances[end], distances[flank]) < CORNER:
        along, across = _overlaps(body, other)
        return end if along < across else flank
    return min(distances, key=lambda side: distances[side])


def _overlaps(body: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """Return the overlaps of two bodies along and across the first one [m]; negative for gaps."""
    dx, dy = other[0] - body[0], other[1] - body[1]
    cos, sin = math.cos(body[6]), math.sin(body[6])
    turned = other[6] - body[6]
    c, s = abs(math.cos(turned)), abs(math.sin(turned))
    along = (body[3] + c * other[3] + s * other[4]) / 2.0 - abs(cos * dx + sin * dy)
    across = (body[4] + s * other[3] + c * other[4]) / 2.0 - abs(cos * dy - sin * dx)
    return along, across


def approached_side(before: WorldView, of: str, other: str) -> Side | None:
    """Return the face of `of` towards which `other` moves, in the frame before the contact.

    None if they do not approach each other there.

    It is the face across whose axis the bodies are separated the longest. The point of contact does not tell it: two
    faces that touch are reported by a corner, and the bodies move on until the end of the time step.
    """
    body, there = before.plain_boxes[before.rows[of]], before.plain_boxes[before.rows[other]]
    own, their = before.states[before.rows[of]], before.states[before.rows[other]]
    cos, sin = math.cos(body[6]), math.sin(body[6])
    dx, dy = there[0] - body[0], there[1] - body[1]
    vx, vy = their.velocity_x - own.velocity_x, their.velocity_y - own.velocity_y
    turn = there[6] - body[6]
    along = abs(math.cos(turn)) * there[3] + abs(math.sin(turn)) * there[4]
    across = abs(math.sin(turn)) * there[3] + abs(math.cos(turn)) * there[4]
    ways: tuple[tuple[float, float, float, tuple[Side, Side]], ...] = (
        (cos * dx + sin * dy, cos * vx + sin * vy, (body[3] + along) / 2.0, ("front", "rear")),
        (cos * dy - sin * dx, cos * vy - sin * vx, (body[4] + across) / 2.0, ("left", "right")),
    )
    longest, side = 0.0, None
    for offset, speed, reach, (positive, negative) in ways:
        gap, closing = abs(offset) - reach, -math.copysign(speed, offset * speed)
        time = gap / closing if closing > 0.0 else 0.0
        if time > longest:
            longest, side = time, positive if offset > 0.0 else negative
    return side


def judge_impact(
    view: WorldView, before: WorldView | None, of: str, other: str, x: float, y: float, lanes: LaneTracker | None
) -> Impact:
    """Return side and fault of a contact at x, y of the actor `of`.

    before  frame before the contact, whose speeds count; `view` if the actors were not present there
    lanes   lanes under the actor; None without roads: a lateral contact is then not its fault
    """
    row = view.rows[of]
    partner = view.plain_boxes[view.rows[other]] if other in view.rows else None
    side = None
    if before is not None and of in before.rows and other in before.rows:
        side = approached_side(before, of, other)
    side = side or side_of(view.plain_boxes[row], x, y, partner)
    if _speed(view, before, of) <= STOPPED:
        obstruction = None if lanes is None else _obstruction(view, row, lanes)
        reason = "it had stopped" if obstruction is None else f"it had stopped {obstruction}"
        return Impact(side, obstruction is not None, reason)
    if other not in view.rows or _speed(view, before, other) <= STOPPED:
        return Impact(side, True, "the other one had stopped")
    state, there = view.states[row], view.plain_boxes[view.rows[other]]
    reverses = _longitudinal_speed(view, before, of) < -STOPPED
    bearing = math.atan2(there[1] - state.y, there[0] - state.x) - state.yaw - (math.pi if reverses else 0.0)
    if abs(math.remainder(bearing, math.tau)) > BEHIND:
        return Impact(side, False, "it was driving away from it in reverse" if reverses else "it was hit from behind")
    if side == ("rear" if reverses else "front"):
        return Impact(side, True, f"it {'reversed and ' if reverses else ''}hit with its {side}")
    if lanes is None:
        return Impact(side, False, "it was hit at the side")
    if leaves_lane(view, row, lanes):
        return Impact(side, True, "it was in several lanes or off the drivable area")
    return Impact(side, False, "it was in one lane")


def _obstruction(view: WorldView, row: int, lanes: LaneTracker) -> str | None:
    """Return the place where a body stands in the way of others, at which it must not stop; None if it does not."""
    body = np.array(view.plain_boxes[row])
    grid = points_of_boxes(body[None], BODY_GRID)[0]
    points = [(x, y, view.states[row].z) for x, y, _ in grid.tolist()]
    if any("rail" in types or "tram" in types for types in lanes.types_at(points)):
        return "on rails"
    if any(points_in_polygon(grid[:, :2], outline[:, :2]).any() for outline in crosswalks(lanes.roads)):
        return "on a crosswalk"
    if any(lanes.are_against(points, float(body[6]))):
        return "in a lane of the opposite direction"
    return None


def leaves_lane(view: WorldView, row: int, lanes: LaneTracker) -> bool:
    """Whether a body is in several lanes or not wholly on drivable lanes.

    Left and right corners must share a lane, at the front and at the rear; both ends may be in different lanes.
    """
    drivable = lanes.roads.tables.lane_drivable
    under = [{lane for lane in at_corner if drivable[lane]} for at_corner in lanes.rows_at(corners(view, row))]
    front_left, rear_left, rear_right, front_right = under
    return not (front_left & front_right and rear_left & rear_right)


def _speed(view: WorldView, before: WorldView | None, name: str) -> float:
    """Return the speed of an actor before the contact, which changes it [m/s]."""
    state = _state(view, before, name)
    return math.hypot(state.velocity_x, state.velocity_y)


def _longitudinal_speed(view: WorldView, before: WorldView | None, name: str) -> float:
    """Return the speed of an actor along its heading before the contact, negative in reverse [m/s]."""
    state = _state(view, before, name)
    return math.cos(state.yaw) * state.velocity_x + math.sin(state.yaw) * state.velocity_y


def _state(view: WorldView, before: WorldView | None, name: str) -> ActorState:
    source = before if before is not None and name in before.rows else view
    return source.states[source.rows[name]]
