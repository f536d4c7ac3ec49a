"""Lateral maneuvers: change to the lane for overtaking, pass an obstacle on either side."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.detections import VULNERABLE
from eidrive_scenario.driving.planning.behavior.lateral import Body, LateralProfile, change_length, passing, towards
from eidrive_scenario.driving.planning.behavior.prediction import NOTICEABLE
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.situation import Situation
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

SLOWER = 2.0
"""Difference to the wanted speed from which on a slower vehicle is passed [m/s]."""
PATIENCE = 3.0
"""Time for which a vehicle has stood before it is passed [s]; as in Autoware's lane change."""
LONG = 15.0
"""Time after which a vehicle in the middle of the lane counts as parked [s]; before, the vehicle waits behind it."""
WAITING = 1.0
"""Speed below which the vehicle waits [m/s]."""
WRONG_WAY = 2.0
"""Speed against the direction of the lane from which on a vehicle in it is oncoming [m/s]; slower ones maneuver."""
ASIDE = 0.8
"""Offset from the route from which on a standing vehicle is parked at the edge of the lane [m]."""
SETTING_OFF = 5.0
"""Time for which a vehicle may still accelerate after it starts [s]; it is not passed meanwhile."""
SWUNG = 0.3
"""Offset from the route from which on the vehicle is beside it [m]."""
SPARE = 0.2
"""Clearance beside a passed obstacle in addition to the lateral margin [m], so that rounding does not block it."""
LEAST_CLEARANCE = 0.25
"""Minimum clearance in a narrow place [m]."""
BEFORE_OBSTACLE = 2.0
"""Distance between the rear of the vehicle and a passed obstacle at which it starts to return [m]."""
SWUNG_OUT = 1.0
"""Distance by which the front is beside an obstacle when the lateral motion ends [m]; it is 99 % complete before."""
QUEUE_GAP, QUEUE_PATIENCE = 15.0, 20.0
"""Gap between standing vehicles that queue [m], and time for which a queue has stood before it is passed [s]."""
TOGETHER = 25.0
"""Gap below which two obstacles are passed in one maneuver [m]."""
NEAR_STOP = 40.0
"""Distance of a place where traffic stops, ahead of a standing vehicle, within which it queues [m]."""
REAR_REACTION, REAR_DECELERATION, REAR_GAP = 1.0, 1.5, 3.0
"""Reaction time [s] and deceleration [m/s²] that a lane change may require of the traffic behind, and the minimum gap
[m]."""


def passing_profiles(
    situation: Situation, scene: Surroundings, settings: BehaviorSettings, body: Body
) -> list[LateralProfile]:
    """Return maneuvers past what holds the vehicle up, or out of the way of an oncoming vehicle in its lane.

    The result is empty if the vehicle queues or nothing is free beside it.
    """
    head_on = _head_on(situation, scene, body)
    if head_on is not None:
        return _evasions(situation, scene, settings, body, head_on)
    found = []
    held_out = _behind_neighbor(situation, scene, settings, body)
    if held_out is not None:
        found.append(held_out)
    blocker = _blocker(situation, scene, body.center, body.half_width)
    if blocker is None or _queues(situation, scene, blocker):
        return found
    beside = situation.line.lanes_beside(situation.lanes_at(situation.s + 10.0))
    faster, overtaking = beside.faster, beside.overtaking
    if not math.isnan(faster) and _rear_is_free(situation, scene, faster, body.center):
        name = f"change lane to the {'left' if overtaking > 0 else 'right'}"
        start = (*situation.steered, situation.speed)
        found.append(towards(name, faster, *start, settings.lateral_acceleration, side=overtaking))
    for side in (overtaking, -overtaking):
        profile = _around_blocker(situation, scene, settings, blocker, body, side)
        if profile is not None:
            found.append(profile)
    return found


def _head_on(situation: Situation, scene: Surroundings, body: Body) -> int | None:
    """Return the nearest hypothesis that comes towards the vehicle in the lane of its route."""
    ahead = scene.certain & (scene.s[:, 0] > situation.s + body.center) & ~scene.crosses[:, 0]
    in_way = np.abs(scene.d[:, 0]) - scene.half_width[:, 0] < body.half_width
    found: list[int] = np.flatnonzero(ahead & in_way & (scene.speed[:, 0] < -WRONG_WAY)).tolist()
    return min(found, key=lambda row: float(scene.s[row, 0])) if found else None


def _evasions(
    situation: Situation, scene: Surroundings, settings: BehaviorSettings, body: Body, head_on: int
) -> list[LateralProfile]:
    """Return changes to the neighboring lanes that reach as far as an oncoming vehicle, and are free behind.

    The first one is away from the lanes of the opposite direction.
    """
    far = float(scene.s[head_on, 0])
    here, there = (situation.line.lanes_beside(situation.lanes_at(place)) for place in (situation.s + 10.0, far))
    found = []
    for side in (-here.overtaking, here.overtaking):
        offset, beyond = (lanes.left if side > 0 else lanes.right for lanes in (here, there))
        if not (math.isnan(offset) or math.isnan(beyond)) and _rear_is_free(situation, scene, offset, body.center):
            name = f"change lane to the {'left' if side > 0 else 'right'}"
            start = (*situation.steered, situation.speed)
            found.append(towards(name, offset, *start, settings.lateral_acceleration, side=side))
    return found


def _behind_neighbor(
    situation: Situation, scene: Surroundings, settings: BehaviorSettings, body: Body
) -> LateralProfile | None:
    """Return the motion back to the route behind what stands between it and the vehicle; None if nothing does.

    The maneuver past an obstacle ends where its end was when the maneuver began, and the estimate may have changed.
    """
    s, d, slope = situation.steered
    if abs(d) < SWUNG:
        return None
    side = 1 if d > 0.0 else -1
    ends = scene.s[:, 0] + scene.half_length[:, 0]
    is_beside = (ends > situation.s - body.rear) & (scene.s[:, 0] - scene.half_length[:, 0] < situation.s + body.front)
    between = side * scene.d[:, 0] - scene.half_width[:, 0] < side * d
    in_way = np.abs(scene.d[:, 0]) - scene.half_width[:, 0] < body.half_width + scene.margin
    rows = np.flatnonzero(is_beside & between & in_way & ~scene.crosses[:, 0] & (np.abs(scene.speed[:, 0]) < WAITING))
    if not rows.size:
        return None
    last = int(rows[np.argmax(ends[rows])])
    end = max(float(ends[last]) + body.rear + body.wheelbase + BEFORE_OBSTACLE, s + 1.0)
    back = change_length(d, max(situation.speed, 2.0), settings.lateral_acceleration)
    name = f"pass {situation.kind_of(scene.owner[last])} on the {'left' if side > 0 else 'right'}"
    own, _ = situation.line.lanes_beside(situation.lanes_at(end)).room(side)
    return LateralProfile(
        name, (s, end, end + back), (d, d, 0.0), slope, side, uses_oncoming=abs(d) + body.half_width > own
    )


def _blocker(situation: Situation, scene: Surroundings, center: float, half_width: float) -> int | None:
    """Return the nearest hypothesis on the route ahead that is slower than the vehicle wants to drive."""
    ahead = (scene.s[:, 0] > situation.s + center) & ~scene.crosses[:, 0]
    in_way = np.abs(scene.d[:, 0]) - scene.half_width[:, 0] < half_width + scene.margin
    slower = (scene.speed[:, 0] > -0.5) & (scene.speed[:, 0] < situation.wanted - SLOWER)
    found: list[int] = np.flatnonzero(ahead & in_way & slower).tolist()
    passable = [row for row in found if _is_passable(situation, scene, row)]
    return min(passable, key=lambda row: float(scene.s[row, 0])) if passable else None


def _is_passable(situation: Situation, scene: Surroundings, row: int) -> bool:
    """Return whether an object may be passed: not a crossing pedestrian, and standing for some time or moving."""
    known = situation.objects[scene.owner[row]]
    if known.still_since is not None:
        stands = situation.now - known.still_since
        is_aside = abs(float(scene.d[row, 0])) > ASIDE
        waits = situation.speed < WAITING or stands >= LONG
        return known.kind == "misc" or (stands >= PATIENCE and (is_aside or waits))
    return known.kind not in ("pedestrian",)


def _is_steady(situation: Situation, scene: Surroundings, row: int) -> bool:
    """Return whether an object has moved for some time, and neither sets off nor brakes."""
    known = situation.objects[scene.owner[row]]
    has_moved = known.moving_since is not None and situation.now - known.moving_since >= SETTING_OFF
    return has_moved and known.acceleration > -NOTICEABLE


def _queues(situation: Situation, scene: Surroundings, blocker: int) -> bool:
    """Return whether the blocker waits at a place where the vehicle stops as well, or behind another vehicle."""
    if situation.stop is not None and situation.stop.s < float(scene.s[blocker, 0]) + NEAR_STOP:
        return True
    known = situation.objects[scene.owner[blocker]]
    if known.still_since is None or situation.now - known.still_since >= QUEUE_PATIENCE:
        return False
    gap = scene.s[:, 0] - scene.half_length[:, 0] - float(scene.s[blocker, 0] + scene.half_length[blocker, 0])
    before = (gap > -0.5) & (gap < QUEUE_GAP) & (np.abs(scene.d[:, 0] - scene.d[blocker, 0]) < 1.0)
    return bool(before.any())


def _rear_is_free(situation: Situation, scene: Surroundings, offset: float, center: float) -> bool:
    """Return whether traffic behind on a lane can adapt to the vehicle with little braking."""
    on_lane = np.abs(scene.d[:, 0] - offset) < scene.half_width[:, 0] + 1.0
    for row in np.flatnonzero(on_lane & (scene.s[:, 0] <= situation.s + center)).tolist():
        gap = situation.s - 1.0 - float(scene.s[row, 0] + scene.half_length[row, 0])
        closing = max(float(scene.speed[row, 0]) - situation.speed, 0.0)
        if gap < REAR_GAP + REAR_REACTION * closing + closing**2 / (2.0 * REAR_DECELERATION):
            return False
    return True


def _around_blocker(
    situation: Situation,
    scene: Surroundings,
    settings: BehaviorSettings,
    blocker: int,
    body: Body,
    side: int,
) -> LateralProfile | None:
    """Return the motion past the blocker, and what stands close behind it, on one side; None if that is too narrow."""
    half_width = body.half_width
    rows = _together(situation, scene, blocker, half_width)
    wanted = max(situation.wanted, 1.0)
    begin = float((scene.s[rows, 0] - scene.half_length[rows, 0]).min()) - (body.front - body.wheelbase) + SWUNG_OUT
    ends = scene.s[rows, 0] + scene.half_length[rows, 0]
    speed = np.maximum(scene.speed[rows, 0], 0.0)
    if bool((speed > 0.5).any()):
        if float(wanted - speed.max()) < SLOWER or not all(_is_steady(situation, scene, row) for row in rows):
            return None
        duration = (ends - situation.s) / np.maximum(wanted - speed, 0.5)
        ends = ends + speed * duration
        begin += float(speed.min()) * max(begin - situation.s, 0.0) / max(wanted - float(speed.min()), 0.5)
    end = float(ends.max()) + body.rear + body.wheelbase + BEFORE_OBSTACLE
    beside = [situation.line.lanes_beside(situation.lanes_at(place)) for place in np.linspace(begin, end, 4).tolist()]
    vulnerable = any(situation.kind_of(scene.owner[row]) in VULNERABLE for row in rows)
    clearance = settings.pedestrian_margin if vulnerable else settings.lateral_margin
    outer = float((side * scene.d[rows, 0] + scene.half_width[rows, 0]).max())
    own, every = (min(edges) for edges in zip(*(lanes.room(side) for lanes in beside), strict=True))
    room = every - outer - 2.0 * half_width
    if room < (clearance + SPARE if vulnerable else min(LEAST_CLEARANCE, clearance + SPARE)):
        return None
    value = max(outer + _beside_obstacle(room, clearance) + half_width, 0.0)
    profile = passing(
        f"pass {situation.kind_of(scene.owner[blocker])} on the {'left' if side > 0 else 'right'}",
        side * value,
        (begin, end),
        *situation.steered,
        max(situation.speed, 2.0),
        settings.lateral_acceleration,
        side,
    )
    if profile is not None and value + half_width > own:
        return msgspec.structs.replace(profile, uses_oncoming=True)
    return profile


def _beside_obstacle(room: float, clearance: float) -> float:
    """Return the distance from an obstacle [m] if the road leaves `room` [m] in addition to the vehicle."""
    if room >= clearance + SPARE:
        return clearance + SPARE
    return (clearance + room) / 2.0 if room > clearance else LEAST_CLEARANCE


def _together(situation: Situation, scene: Surroundings, blocker: int, half_width: float) -> list[int]:
    """Return the blocker and the objects of similar speed in the way that follow it closely."""
    in_way = np.abs(scene.d[:, 0]) - scene.half_width[:, 0] < half_width + scene.margin
    alike = np.abs(scene.speed[:, 0] - scene.speed[blocker, 0]) < 1.0
    rows = np.flatnonzero(in_way & alike & ~scene.crosses[:, 0] & (scene.s[:, 0] >= scene.s[blocker, 0]))
    order = sorted(rows.tolist(), key=lambda row: float(scene.s[row, 0]))
    found = [blocker]
    for row in order:
        last = found[-1]
        gap = float(scene.s[row, 0] - scene.half_length[row, 0] - scene.s[last, 0] - scene.half_length[last, 0])
        if gap > TOGETHER:
            break
        if row != blocker:
            found.append(row)
    return found
