"""Lateral maneuvers: change to the lane for overtaking, pass an obstacle on either side."""

from __future__ import annotations

import math
from operator import attrgetter

from eidrive_scenario.driving.planning.behavior.lateral import Body, LateralProfile, change_length, towards
from eidrive_scenario.driving.planning.behavior.obstacles import (
    BEFORE_OBSTACLE,
    SLOWER,
    is_in_way,
    motion_around,
    obstacle_of,
)
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.situation import Situation
from eidrive_scenario.driving.planning.behavior.surroundings import Present, Surroundings

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
SWUNG = 0.3
"""Offset from the route from which on the vehicle is beside it [m]."""
QUEUE_GAP, QUEUE_PATIENCE = 15.0, 20.0
"""Gap between standing vehicles that queue [m], and time for which a queue has stood before it is passed [s]."""
NEAR_STOP = 40.0
"""Distance of a place where traffic stops, ahead of a standing vehicle, within which it queues [m]."""
REAR_REACTION, REAR_DECELERATION, REAR_GAP = 1.0, 1.5, 3.0
"""Reaction time [s] and deceleration [m/s²] that a lane change may require of the traffic behind, and the minimum gap
[m]."""


def passing_profiles(
    situation: Situation,
    scene: Surroundings,
    settings: BehaviorSettings,
    body: Body,
    current: LateralProfile | None = None,
) -> list[LateralProfile]:
    """Return maneuvers past what holds the vehicle up, or out of the way of an oncoming vehicle in its lane.

    The result is empty if the vehicle queues or nothing is free beside it.

    current  present maneuver; passing a moving object keeps its begin, and its end follows the object
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
    obstacle = obstacle_of(situation, scene, blocker, body, settings.acceleration)
    if obstacle is not None:
        # The lane for overtaking, where traffic may come from behind, is entered by a lane change if the object moves.
        changes = obstacle.moves and not math.isnan(faster)
        sides = (-overtaking,) if changes else (overtaking, -overtaking)
        around = [motion_around(situation, settings, obstacle, body, side, current) for side in sides]
        found += [profile for profile in around if profile is not None]
    return found


def _head_on(situation: Situation, scene: Surroundings, body: Body) -> Present | None:
    """Return the nearest hypothesis that comes towards the vehicle in the lane of its route."""
    center = situation.s + body.center
    found = [
        one
        for one in scene.present
        if one.speed < -WRONG_WAY
        and one.s > center
        and not one.crosses
        and abs(one.d) - one.half_width < body.half_width
        and scene.certain[one.row]
    ]
    return min(found, key=attrgetter("s"), default=None)


def _evasions(
    situation: Situation, scene: Surroundings, settings: BehaviorSettings, body: Body, head_on: Present
) -> list[LateralProfile]:
    """Return changes to the neighboring lanes that reach as far as an oncoming vehicle, and are free behind.

    The first one is away from the lanes of the opposite direction.
    """
    places = (situation.s + 10.0, head_on.s)
    here, there = (situation.line.lanes_beside(situation.lanes_at(place)) for place in places)
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
    rear, front = situation.s - body.rear, situation.s + body.front
    found = [
        one
        for one in scene.present
        if one.front > rear
        and one.rear < front
        and side * one.d - one.half_width < side * d
        and is_in_way(one, body.half_width)
        and not one.crosses
        and abs(one.speed) < WAITING
    ]
    if not found:
        return None
    last = max(found, key=attrgetter("front"))
    end = max(last.front + body.rear + body.wheelbase + BEFORE_OBSTACLE, s + 1.0)
    back = change_length(d, max(situation.speed, 2.0), settings.lateral_acceleration)
    name = f"pass {situation.kind_of(last.owner)} on the {'left' if side > 0 else 'right'}"
    own, _ = situation.line.lanes_beside(situation.lanes_at(end)).room(side)
    return LateralProfile(
        name, (s, end, end + back), (d, d, 0.0), slope, side, uses_oncoming=abs(d) + body.half_width > own
    )


def _blocker(situation: Situation, scene: Surroundings, center: float, half_width: float) -> Present | None:
    """Return the nearest hypothesis on the route ahead that is slower than the vehicle wants to drive."""
    place, slower = situation.s + center, situation.wanted - SLOWER
    found = [
        one
        for one in scene.present
        if one.s > place
        and -0.5 < one.speed < slower
        and not one.crosses
        and is_in_way(one, half_width)
        and _is_passable(situation, one)
    ]
    return min(found, key=attrgetter("s"), default=None)


def _is_passable(situation: Situation, one: Present) -> bool:
    """Return whether an object may be passed: not a crossing pedestrian, and standing for some time or moving."""
    known = situation.objects[one.owner]
    if known.still_since is not None:
        stands = situation.now - known.still_since
        is_aside = abs(one.d) > ASIDE
        waits = situation.speed < WAITING or stands >= LONG
        return known.kind == "misc" or (stands >= PATIENCE and (is_aside or waits))
    return known.kind not in ("pedestrian",)


def _queues(situation: Situation, scene: Surroundings, blocker: Present) -> bool:
    """Return whether the blocker waits at a place where the vehicle stops as well, or behind another vehicle."""
    if situation.stop is not None and situation.stop.s < blocker.s + NEAR_STOP:
        return True
    known = situation.objects[blocker.owner]
    if known.still_since is None or situation.now - known.still_since >= QUEUE_PATIENCE:
        return False
    return any(-0.5 < one.rear - blocker.front < QUEUE_GAP and abs(one.d - blocker.d) < 1.0 for one in scene.present)


def _rear_is_free(situation: Situation, scene: Surroundings, offset: float, center: float) -> bool:
    """Return whether traffic behind on a lane can adapt to the vehicle with little braking."""
    for one in scene.present:
        if abs(one.d - offset) < one.half_width + 1.0 and one.s <= situation.s + center:
            gap = situation.s - 1.0 - one.front
            closing = max(one.speed - situation.speed, 0.0)
            if gap < REAR_GAP + REAR_REACTION * closing + closing**2 / (2.0 * REAR_DECELERATION):
                return False
    return True
