"""Proposals: a lateral profile, a target speed, and whom the vehicle gives way to."""

from __future__ import annotations

import math
from typing import Literal

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.driving.planning.behavior.lateral import LateralProfile
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

Precedence = Literal["all", "earlier", "none"]
"""Crossing and merging traffic to which a proposal gives way: all of it, what arrives earlier, or none."""

SPEED_SHARES = (1.0, 0.7, 0.4)
"""Target speeds of proposals, as shares of the wanted speed."""
ONCOMING_SPEED = 0.5
"""Speed against the direction of the vehicle above which an object is oncoming [m/s]."""
BEFORE_ZONE = 1.5
"""Distance between the front of a waiting vehicle and the zone that others cross [m]."""
RELEASE = 0.3
"""Time after which a zone counts as free when the crossing object has left it [s]."""


class Proposal(msgspec.Struct, frozen=True):
    """Proposal: index of its lateral profile, share of the wanted speed, and precedence of others.

    deceleration  maximum deceleration [m/s²];  is_emergency  whether the vehicle brakes with it constantly
    """

    profile: int
    share: float
    precedence: Precedence
    deceleration: float
    is_emergency: bool = False
    is_gentle: bool = False
    """Whether it stops for an object whose existence is uncertain; it may come closer to others than it should."""


class Wall(msgspec.Struct, frozen=True):
    """Place that the reference point of the vehicle does not pass before a time [s]."""

    s: float
    until: float
    reason: str
    owner: int | None = None
    """Index of the hypothesis for which the vehicle waits."""


class Conflict(msgspec.Struct, frozen=True):
    """Object that enters the way of one profile later.

    first, last  indices of the times of its occupation;  s  first place that it occupies [m]
    crosses      False for an object that then drives in the direction of the vehicle
    """

    hypothesis: int
    first: int
    last: int
    s: float
    crosses: bool


def inside_way(scene: Surroundings, profile: LateralProfile, half_width: float, extra: float = 0.0) -> Bools:
    """Return where hypotheses are in the way (N, K) of a vehicle that follows a profile."""
    gap = np.abs(profile.offset(scene.s) - scene.d) - scene.half_width
    return np.asarray(gap < half_width + scene.margin[:, None] * 0.5 + extra)


def conflicts(scene: Surroundings, way: Bools, front: float) -> list[Conflict]:
    """Return the objects that are outside the way (N, K) now and inside it later, ahead of `front` [m]."""
    found = []
    meets: Bools = np.logical_or.reduce(way & scene.crosses, axis=1) | (np.logical_or.reduce(way, axis=1) & ~way[:, 0])
    for row in (meets & ~scene.behind).nonzero()[0].tolist():
        steps = np.flatnonzero(way[row])
        first = int(steps[0])
        crosses = bool(scene.crosses[row, steps].any())
        run = int(np.argmin(np.append(way[row, first:], False))) + first - 1
        occupied = slice(first, run + 1)
        if float(scene.front[row, occupied].max()) < front:
            continue
        s = float(scene.rear[row, occupied].min())
        found.append(Conflict(row, first, run, s, crosses))
    return found


def crossing_walls(
    found: list[Conflict], times: Array, ego: tuple[float, float, float], precedence: Precedence, reasons: list[str]
) -> list[Wall]:
    """Return the walls before the zones of crossing objects to which a proposal gives way.

    ego  distance of the front from the reference point [m], current distance along the line [m], speed [m/s]
    """
    front, s, speed = ego
    walls = []
    for conflict in found:
        if not conflict.crosses or precedence == "none":
            continue
        arrival = (conflict.s - front - s) / max(speed, 1.0)
        if precedence == "earlier" and arrival < times[conflict.first]:
            continue
        until = math.inf if conflict.last == len(times) - 1 else float(times[conflict.last]) + RELEASE
        walls.append(Wall(conflict.s - front - BEFORE_ZONE, until, reasons[conflict.hypothesis], conflict.hypothesis))
    return walls


def proposals_for(
    profile: int, found: list[Conflict], settings: BehaviorSettings, *, emergency: float, is_current: bool
) -> list[Proposal]:
    """Return the proposals along one profile.

    emergency  deceleration of the emergency brake [m/s²];  is_current  whether they include stopping
    """
    hard = settings.hard_deceleration
    kinds: tuple[Precedence, ...] = ("all", "earlier", "none") if any(c.crosses for c in found) else ("all",)
    made = [Proposal(profile, share, kind, hard) for kind in kinds for share in SPEED_SHARES]
    if is_current:
        made.append(Proposal(profile, 0.0, "all", hard))
        made.append(Proposal(profile, 0.0, "all", settings.comfortable_deceleration, is_gentle=True))
        made.append(Proposal(profile, 0.0, "all", emergency, is_emergency=True))
    return made


def speed_limits(curvature: Array, path_limits: Array, spacing: float, settings: BehaviorSettings) -> Array:
    """Return the speed limits (M,) by curves and the end of the path, approached with a comfortable deceleration."""
    kernel = np.ones(5) / 5.0
    smooth = np.convolve(np.abs(np.pad(curvature, 2, mode="edge")), kernel, mode="valid")
    limits = np.minimum(np.sqrt(settings.lateral_acceleration / np.maximum(smooth, 1e-4)), path_limits)
    gain = 2.0 * settings.comfortable_deceleration * spacing
    values: list[float] = limits.tolist()
    for index in range(len(values) - 2, -1, -1):
        values[index] = min(values[index], math.sqrt(values[index + 1] ** 2 + gain))
    return np.array(values)


def leading(scene: Surroundings, way: Bools, found: list[Conflict], center: float, proposal: Proposal) -> Bools:
    """Return where hypotheses lead the vehicle (N, K): in its way and not crossing.

    An object that enters the way in the direction of the vehicle leads it from now on, if the vehicle gives way.
    """
    leads = way & scene.may_lead
    if proposal.precedence == "all":
        for conflict in found:
            row = conflict.hypothesis
            is_oncoming = float(scene.speed[row, conflict.first]) < -ONCOMING_SPEED
            if not conflict.crosses and not is_oncoming and float(scene.s[row, 0]) > center:
                leads[row, : conflict.first] = True
    return np.asarray(leads)
