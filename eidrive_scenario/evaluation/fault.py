"""Side and fault of a collision by the rules of nuPlan (metric `no_ego_at_fault_collisions`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from eidrive_scenario.base.geometry import components, points_in_polygon, points_of_boxes
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.evaluation.actor_tracking import LaneTracker, corners
from eidrive_scenario.roads.objects import crosswalks
from eidrive_scenario.world.view import WorldView

STOPPED = 0.05 + EPSILON
"""Maximum speed of a stopped actor [m/s], with the rounding error of its calculation."""
BEHIND = math.radians(150.0) + EPSILON
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
    ahead, left = components(x - body[0], y - body[1], body[6])
    distances: dict[Side, float] = {
        "front": abs(body[3] / 2.0 - ahead),
        "rear": abs(body[3] / 2.0 + ahead),
        "left": abs(body[4] / 2.0 - left),
        "right": abs(body[4] / 2.0 + left),
    }
    if other is not None:
        center_ahead, center_left, reach_ahead, reach_left = _relative(body, other)
        end: Side = "front" if ahead >= 0.0 else "rear"
        flank: Side = "left" if left >= 0.0 else "right"
        if max(distances[end], distances[flank]) < CORNER:
            return end if reach_ahead - abs(center_ahead) < reach_left - abs(center_left) else flank
    return min(distances, key=lambda side: distances[side])


def _relative(body: Sequence[float], other: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the center of another body (7,) ahead and left of this one, and its distances along both axes at which
    the projections of the bodies touch [m]."""
    ahead, left = components(other[0] - body[0], other[1] - body[1], body[6])
    c, s = abs(math.cos(other[6] - body[6])), abs(math.sin(other[6] - body[6]))
    reach_ahead, reach_left = body[3] + c * other[3] + s * other[4], body[4] + s * other[3] + c * other[4]
    return ahead, left, reach_ahead / 2.0, reach_left / 2.0


def approached_side(before: WorldView, of: str, other: str) -> Side | None:
    """Return the face of `of` towards which `other` moves, in the frame before the contact.

    None if they do not approach each other there.

    It is the face across whose axis the bodies are separated the longest. The point of contact does not tell it: two
    faces that touch are reported by a corner, and the bodies move on until the end of the time step.
    """
    body = before.plain_boxes[before.rows[of]]
    own, their = before.states[before.rows[of]], before.states[before.rows[other]]
    vx, vy = components(their.velocity_x - own.velocity_x, their.velocity_y - own.velocity_y, body[6])
    ahead, left, reach_ahead, reach_left = _relative(body, before.plain_boxes[before.rows[other]])
    ways: tuple[tuple[float, float, float, tuple[Side, Side]], ...] = (
        (ahead, vx, reach_ahead, ("front", "rear")),
        (left, vy, reach_left, ("left", "right")),
    )
    longest, side = 0.0, None
    for offset, speed, reach, (positive, negative) in ways:
        gap, closing = abs(offset) - reach, -math.copysign(speed, offset * speed)
        time = gap / closing if closing > EPSILON else 0.0
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

    def speeds(name: str) -> tuple[float, float]:
        """Return the speed of an actor before the contact, which changes it, and that along its heading [m/s]."""
        source = before if before is not None and name in before.rows else view
        state = source.states[source.rows[name]]
        vx, vy = state.velocity_x, state.velocity_y
        return math.hypot(vx, vy), math.cos(state.yaw) * vx + math.sin(state.yaw) * vy

    row, (speed, longitudinal_speed) = view.rows[of], speeds(of)
    partner = view.plain_boxes[view.rows[other]] if other in view.rows else None
    side = None
    if before is not None and of in before.rows and other in before.rows:
        side = approached_side(before, of, other)
    side = side or side_of(view.plain_boxes[row], x, y, partner)
    if speed <= STOPPED:
        obstruction = None if lanes is None else _obstruction(view, row, lanes)
        reason = "it had stopped" if obstruction is None else f"it had stopped {obstruction}"
        return Impact(side, obstruction is not None, reason)
    if partner is None or speeds(other)[0] <= STOPPED:
        return Impact(side, True, "the other one had stopped")
    state = view.states[row]
    reverses = longitudinal_speed < -STOPPED
    bearing = math.atan2(partner[1] - state.y, partner[0] - state.x) - state.yaw - (math.pi if reverses else 0.0)
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
