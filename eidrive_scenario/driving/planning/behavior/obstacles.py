"""Passing of obstacles: where the vehicle is beside them, and the motion past them on one side."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import NamedTuple

import msgspec

from eidrive_scenario.detections import VULNERABLE
from eidrive_scenario.driving.planning.behavior.lateral import Body, LateralProfile, change_length, passing
from eidrive_scenario.driving.planning.behavior.prediction import NOTICEABLE
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.situation import Situation
from eidrive_scenario.driving.planning.behavior.surroundings import Present, Surroundings

SLOWER = 2.0
"""Difference to the wanted speed from which on a slower vehicle is passed [m/s]."""
SETTING_OFF = 5.0
"""Time for which a vehicle may still accelerate after it starts [s]; it is not passed meanwhile."""
SPARE = 0.2
"""Clearance beside a passed obstacle in addition to the lateral margin [m], so that rounding does not block it."""
LEAST_CLEARANCE = 0.25
"""Minimum clearance in a narrow place [m]."""
BEFORE_OBSTACLE = 2.0
"""Distance between the rear of the vehicle and a passed obstacle at which it starts to return [m]."""
SWUNG_OUT = 1.0
"""Distance by which the front is beside an obstacle when the lateral motion ends [m]; it is 99 % complete before."""
TOGETHER = 25.0
"""Gap below which two obstacles are passed in one maneuver [m]."""


class Obstacle(NamedTuple):
    """Objects that hold the vehicle up, the nearest first, and the places between which it is beside them [m].

    beside  lanes at places between both;  moves  whether one of the objects moves
    """

    objects: list[Present]
    begin: float
    end: float
    beside: list[LanesBeside]
    moves: bool


def is_in_way(one: Present, half_width: float) -> bool:
    """Return whether a hypothesis is closer to the route than a vehicle on it should pass."""
    return abs(one.d) - one.half_width < half_width + one.margin


def obstacle_of(
    situation: Situation, scene: Surroundings, blocker: Present, body: Body, acceleration: float
) -> Obstacle | None:
    """Return the blocker with what stands close behind it; None if it is too fast or not steady enough to pass it."""
    objects = _together(scene, blocker, body.half_width)
    wanted = max(situation.wanted, 1.0)
    begin = min([one.rear for one in objects]) - (body.front - body.wheelbase) + SWUNG_OUT
    ends = [one.front for one in objects]
    speed = [max(one.speed, 0.0) for one in objects]
    fastest, slowest = max(speed), min(speed)
    if fastest > 0.5:
        if wanted - fastest < SLOWER or not all(_is_steady(situation, one) for one in objects):
            return None
        ends = [
            end + own * time_to_gain(end - situation.s, own, situation.speed, wanted, acceleration)
            for end, own in zip(ends, speed, strict=True)
        ]
        begin += slowest * max(begin - situation.s, 0.0) / max(wanted - slowest, 0.5)
    end = max(ends) + body.rear + body.wheelbase + BEFORE_OBSTACLE
    step = (end - begin) / 3.0
    places = (begin, begin + step, begin + 2.0 * step, end)
    beside = [situation.line.lanes_beside(situation.lanes_at(place)) for place in places]
    return Obstacle(objects, begin, end, beside, fastest > 0.5)


def motion_around(
    situation: Situation,
    settings: BehaviorSettings,
    obstacle: Obstacle,
    body: Body,
    side: int,
    current: LateralProfile | None,
) -> LateralProfile | None:
    """Return the motion past an obstacle on one side; None if that is too narrow."""
    half_width = body.half_width
    vulnerable = any(situation.kind_of(one.owner) in VULNERABLE for one in obstacle.objects)
    clearance = settings.pedestrian_margin if vulnerable else settings.lateral_margin
    outer = max([side * one.d + one.half_width for one in obstacle.objects])
    own, every = (min(edges) for edges in zip(*(lanes.room(side) for lanes in obstacle.beside), strict=True))
    room = every - outer - 2.0 * half_width
    if room < (clearance + SPARE if vulnerable else min(LEAST_CLEARANCE, clearance + SPARE)):
        return None
    value = max(outer + _beside_obstacle(room, clearance) + half_width, 0.0)
    name = f"pass {situation.kind_of(obstacle.objects[0].owner)} on the {'left' if side > 0 else 'right'}"
    if obstacle.moves and current is not None and current.name == name and len(current.places) > 3:
        # An object beyond the return is another one, for which the vehicle returns before it decides again.
        is_beyond = obstacle.begin > current.places[-2]
        return None if is_beyond else _with_return(current, situation, settings, obstacle.end)
    profile = passing(
        name,
        side * value,
        (obstacle.begin, obstacle.end),
        *situation.steered,
        max(situation.speed, 2.0),
        settings.lateral_acceleration,
        side,
    )
    if profile is None:
        return None
    if obstacle.moves:
        profile = _with_return(profile, situation, settings, obstacle.end)
    if value + half_width > own:
        return msgspec.structs.replace(profile, uses_oncoming=True)
    return profile


def _is_steady(situation: Situation, one: Present) -> bool:
    """Return whether an object has moved for some time, and neither sets off nor brakes."""
    known = situation.objects[one.owner]
    has_moved = known.moving_since is not None and situation.now - known.moving_since >= SETTING_OFF
    return has_moved and known.acceleration > -NOTICEABLE


def _with_return(
    profile: LateralProfile, situation: Situation, settings: BehaviorSettings, place: float
) -> LateralProfile:
    """Return a maneuver past a moving object that returns at this place [m], at the speed reached there."""
    before = profile.places[:-2]
    begin = max(place, before[-1] + 0.5)
    reached = situation.speed**2 + 2.0 * settings.acceleration * max(begin - situation.s, 0.0)
    speed = max(min(math.sqrt(reached), situation.wanted), 2.0)
    back = change_length(profile.values[-2], speed, settings.lateral_acceleration)
    return msgspec.structs.replace(profile, places=(*before, begin, begin + back), passes_moving=True)


def time_to_gain(distance: float, other: float, speed: float, wanted: float, acceleration: float) -> float:
    """Return the time [s] until a vehicle that accelerates has gained a distance [m] on another one.

    other, speed, wanted  speeds of the other one, of the vehicle now, and that it accelerates to [m/s]
    """
    speed = min(speed, wanted)
    gaining = (wanted - speed) / acceleration
    closing = speed - other
    if distance <= gaining * (closing + acceleration * gaining / 2.0):
        return (math.sqrt(closing * closing + 2.0 * acceleration * max(distance, 0.0)) - closing) / acceleration
    return (distance + acceleration * gaining * gaining / 2.0) / max(wanted - other, 0.5)


def _beside_obstacle(room: float, clearance: float) -> float:
    """Return the distance from an obstacle [m] if the road leaves `room` [m] in addition to the vehicle."""
    if room >= clearance + SPARE:
        return clearance + SPARE
    return (clearance + room) / 2.0 if room > clearance else LEAST_CLEARANCE


def _together(scene: Surroundings, blocker: Present, half_width: float) -> list[Present]:
    """Return the blocker and the objects of similar speed in the way that follow it closely."""
    alike = [
        one
        for one in scene.present
        if one.s >= blocker.s
        and not one.crosses
        and abs(one.speed - blocker.speed) < 1.0
        and is_in_way(one, half_width)
    ]
    found = [blocker]
    for one in sorted(alike, key=attrgetter("s")):
        if one.rear - found[-1].s - found[-1].half_length > TOGETHER:
            break
        if one.row != blocker.row:
            found.append(one)
    return found
