"""Side and fault of a collision by the rules of nuPlan (metric `no_ego_at_fault_collisions`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from eidrive_scenario.evaluation.lane_tracking import LaneTracker, corners
from eidrive_scenario.world.view import WorldView

STOPPED = 0.05
"""Maximum speed of a stopped actor [m/s]."""
BEHIND = math.radians(150.0)
"""Angle at the reference point between the heading and the center of an actor beyond which that actor is behind."""

Side = Literal["front", "rear", "left", "right"]


class Impact(NamedTuple):
    """Side of a body that was hit, whether its actor is at fault, and the rule that decides."""

    side: Side
    at_fault: bool
    rule: str


def side_of(body: Sequence[float], x: float, y: float) -> Side:
    """Return the face of a body (7,) that is nearest to a point of contact."""
    dx, dy = x - body[0], y - body[1]
    cos, sin = math.cos(body[6]), math.sin(body[6])
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    distances: dict[Side, float] = {
        "front": abs(body[3] / 2.0 - ahead),
        "rear": abs(body[3] / 2.0 + ahead),
        "left": abs(body[4] / 2.0 - left),
        "right": abs(body[4] / 2.0 + left),
    }
    return min(distances, key=lambda side: distances[side])


def judge_impact(
    view: WorldView, before: WorldView | None, of: str, other: str, x: float, y: float, lanes: LaneTracker | None
) -> Impact:
    """Return side and fault of a contact at x, y of the actor `of`.

    before  frame before the contact, whose speeds count; `view` if the actors were not present there
    lanes   lanes under the actor; None without roads: a lateral contact is then not its fault
    """
    row = view.rows[of]
    side = side_of(view.plain_boxes[row], x, y)
    if _speed(view, before, of) <= STOPPED:
        return Impact(side, False, "it had stopped")
    if other not in view.rows or _speed(view, before, other) <= STOPPED:
        return Impact(side, True, "the other one had stopped")
    state, there = view.states[row], view.plain_boxes[view.rows[other]]
    bearing = math.atan2(there[1] - state.y, there[0] - state.x) - state.yaw
    if abs(math.remainder(bearing, math.tau)) > BEHIND:
        return Impact(side, False, "it was hit from behind")
    if side == "front":
        return Impact(side, True, "it hit with its front")
    if lanes is None:
        return Impact(side, False, "it was hit at the side")
    if leaves_lane(view, row, lanes):
        return Impact(side, True, "it was in several lanes or off the drivable area")
    return Impact(side, False, "it was in one lane")


def leaves_lane(view: WorldView, row: int, lanes: LaneTracker) -> bool:
    """Whether a body is in several lanes or not wholly on drivable lanes.

    Left and right corners must share a lane, at the front and at the rear; both ends may be in different lanes.
    """
    drivable = lanes.roads.tables.lane_drivable
    under = [{lane for lane in found if drivable[lane]} for found in lanes.rows_at(corners(view, row))]
    front_left, rear_left, rear_right, front_right = under
    return not (front_left & front_right and rear_left & rear_right)


def _speed(view: WorldView, before: WorldView | None, name: str) -> float:
    """Return the speed of an actor before the contact, which changes it [m/s]."""
    source = before if before is not None and name in before.rows else view
    state = source.states[source.rows[name]]
    return math.hypot(state.velocity_x, state.velocity_y)
