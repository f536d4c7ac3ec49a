"""Rollout of proposals: motion along the line with limits, walls and leaders."""

from __future__ import annotations

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.car_following import Drivers, IntelligentDriver
from eidrive_scenario.driving.planning.behavior.proposals import Proposal, Wall
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

FREE, LIMIT, WALL = -1, -2, -3
"""Cause of the motion of a proposal in a step: nothing, a speed limit, or a wall (WALL - its index); an index from 0
on is that of a leading hypothesis."""
ROLLED = 6
"""Number of first steps whose causes are kept."""
FAR = 1e6
"""Place of walls and leaders that do not exist [m]."""
NEGLIGIBLE = 1e-6
"""Deceleration due to a leader below which there is none [m/s²]."""


class Rollout(msgspec.Struct, frozen=True):
    """Motion of P proposals at K times: distance along the line s (P, K) [m], speed (P, K) [m/s], cause (P, ROLLED)."""

    s: Array
    speed: Array
    cause: Integers


class Course(msgspec.Struct, frozen=True):
    """Limits of the motion along the line: speed limits (M,) [m/s] at distances along it (M,) [m]."""

    along: Array
    limits: Array
    wanted: float
    """Wanted speed [m/s]."""


class Roller:
    """Rollout of all proposals in one batch."""

    def __init__(self, settings: BehaviorSettings, times: Array) -> None:
        self._settings = settings
        self._times = times
        self._driver = Drivers.of(
            [
                IntelligentDriver(
                    time_gap=settings.time_gap,
                    standstill_gap=settings.standstill_gap,
                    acceleration=settings.acceleration,
                    deceleration=settings.comfortable_deceleration,
                    emergency=settings.hard_deceleration,
                )
            ]
        )

    def roll(
        self,
        proposals: list[Proposal],
        course: Course,
        start: tuple[float, float],
        body: tuple[float, float],
        scene: Surroundings,
        leads: Bools,
        walls: list[list[Wall]],
    ) -> Rollout:
        """Return the motion of the proposals.

        start  distance along the line [m] and speed [m/s]
        body   distances of the front and the center of the vehicle from the reference point [m]
        leads  (P, N, K) whether a hypothesis leads a proposal at a time
        """
        count, steps = len(proposals), len(self._times)
        s, speed = np.full((count, steps), start[0]), np.full((count, steps), start[1])
        cause = np.full((count, ROLLED), FREE)
        wanted = np.array([proposal.share for proposal in proposals]) * course.wanted
        emergency = np.array([proposal.is_emergency for proposal in proposals], dtype=bool)
        least = -np.array([proposal.deceleration for proposal in proposals])
        wall_s, wall_until = _walls(walls)
        rows = np.flatnonzero(leads.any(axis=(0, 2)))
        leads, leader_speed = leads[:, rows], scene.speed[rows]
        rear, centers = (
            (scene.s - scene.half_length - scene.passing_gap[:, None])[rows] - body[0],
            scene.s[rows] - body[1],
        )
        for step in range(steps - 1):
            dt = float(self._times[step + 1] - self._times[step])
            here, now = s[:, step], speed[:, step]
            desired, reason = self._desired(here, now, dt, course, wanted, wall_s, wall_until, float(self._times[step]))
            target = (desired - now) / dt
            target = np.where(emergency, least, np.minimum(target, self._settings.acceleration))
            if rows.size:
                is_ahead = leads[:, :, step] & (centers[None, :, step] > here[:, None])
                gap = np.where(is_ahead, rear[None, :, step] - here[:, None], FAR)
                own = now[:, None]
                slowing = self._driver.interaction(own, gap, own - leader_speed[None, :, step])
                hardest = slowing.max(axis=1)
                free = self._driver.free(now, np.maximum(desired, now))
                follow = np.where(hardest > NEGLIGIBLE, free - hardest, FAR)
                if step < ROLLED:
                    reason = np.where(follow < target - 1e-6, rows[np.argmax(slowing, axis=1)], reason)
                target = np.minimum(target, follow)
            acceleration = np.maximum(target, least)
            after = np.maximum(now + acceleration * dt, 0.0)
            s[:, step + 1] = here + 0.5 * (now + after) * dt
            speed[:, step + 1] = after
            if step < ROLLED:
                cause[:, step] = reason
        return Rollout(s, speed, cause)

    def _desired(
        self,
        s: Array,
        speed: Array,
        dt: float,
        course: Course,
        wanted: Array,
        wall_s: Array,
        wall_until: Array,
        time: float,
    ) -> tuple[Array, Integers]:
        """Return the speeds (P,) that limits and walls allow at the next step, and what determines them."""
        ahead = s + speed * dt
        limit = np.interp(ahead, course.along, course.limits)
        desired = np.minimum(wanted, limit)
        reason = np.where(limit < wanted, LIMIT, FREE)
        if wall_s.shape[1]:
            room = np.maximum(wall_s - ahead[:, None], 0.0)
            allowed = np.sqrt(2.0 * self._settings.comfortable_deceleration * room)
            allowed = np.where(time < wall_until, allowed, FAR)
            nearest = np.argmin(allowed, axis=1)
            least = allowed[np.arange(len(allowed)), nearest]
            reason = np.where(least < desired, WALL - nearest, reason)
            desired = np.minimum(desired, least)
        return desired, reason


def _walls(walls: list[list[Wall]]) -> tuple[Array, Array]:
    """Return places and times (P, C) of the walls of each proposal; missing ones are far."""
    most = max((len(row) for row in walls), default=0)
    places, until = np.full((len(walls), most), FAR), np.zeros((len(walls), most))
    for row, found in enumerate(walls):
        for column, wall in enumerate(found):
            places[row, column], until[row, column] = wall.s, wall.until
    return places, until
