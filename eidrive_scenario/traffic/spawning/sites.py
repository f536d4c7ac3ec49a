"""Sites along lanes at which traffic can be spawned, and the test whether they are free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.car_following import Drivers
from eidrive_scenario.geometry import overlap
from eidrive_scenario.roads import LaneLocation
from eidrive_scenario.traffic.cars import PLANNED
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FOREIGN, find_followers, find_leaders
from eidrive_scenario.traffic.spawning.bodies import Participant

SPACING = 5.0
"""Distance between the sites along a lane [m]."""
WIDEST = 2.55
"""Maximum vehicle width for which a lane is required to be wide enough [m]; Directive 96/53/EC."""
FINE_SPACING = 0.5
"""Distance between the sites in an area without sites of the usual distance [m]."""
REACH = 30.0
"""Maximum distance of a traffic position from a lane [m]."""
AIR = 0.5
"""Minimum gap between the box of a new participant and all others [m]."""


@dataclass(frozen=True)
class SpawnSites:
    """Sites (K,) along lanes: row and progress, x, y [m], heading of the traffic [rad], width of the lane [m]."""

    row: Integers
    progress: Array
    x: Array
    y: Array
    heading: Array
    width: Array

    @classmethod
    def along(cls, lanes: TrafficLanes, rows: Integers, spacing: float = SPACING) -> SpawnSites:
        """Return equidistant sites along lanes."""
        counts = np.maximum(np.floor(lanes.length[rows] / spacing).astype(np.int64), 1)
        row = np.repeat(rows, counts)
        number = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        return cls.at(lanes, row, (number + 0.5) * lanes.length[row] / np.repeat(counts, counts))

    @classmethod
    def at(cls, lanes: TrafficLanes, row: Integers, progress: Array) -> SpawnSites:
        """Return sites (K,) at given rows and progress."""
        poses = lanes.tables.lane_poses(row, lanes.s(row, progress), np.zeros(len(row)))
        heading = poses.h + np.where(lanes.direction[row] > 0, 0.0, np.pi)
        return cls(row, progress, poses.x, poses.y, heading, lanes.width(row, progress))

    def __len__(self) -> int:
        return len(self.row)

    def subset(self, which: Integers | Bools) -> SpawnSites:
        """Return a subset of the sites."""
        return SpawnSites(
            self.row[which],
            self.progress[which],
            self.x[which],
            self.y[which],
            self.heading[which],
            self.width[which],
        )

    def concatenate(self, other: SpawnSites) -> SpawnSites:
        """Return the union of the sites."""
        return SpawnSites(
            np.concatenate([self.row, other.row]),
            np.concatenate([self.progress, other.progress]),
            np.concatenate([self.x, other.x]),
            np.concatenate([self.y, other.y]),
            np.concatenate([self.heading, other.heading]),
            np.concatenate([self.width, other.width]),
        )


Covers = Callable[[SpawnSites], Bools]
"""Test whether each site is inside an area."""


class SpawnAreas:
    """Sites of one road network for vehicles and pedestrians."""

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes

    @cached_property
    def driving(self) -> SpawnSites:
        """Sites for vehicles, without lanes that end."""
        return SpawnSites.along(self._lanes, self._rows(walks=False))

    @cached_property
    def walking(self) -> SpawnSites:
        """Sites for pedestrians."""
        return SpawnSites.along(self._lanes, self._rows(walks=True))

    def _rows(self, *, walks: bool) -> Integers:
        lanes = self._lanes
        fit = lanes.walkable if walks else lanes.tables.lane_drivable & np.isinf(lanes.ends_at)
        return np.flatnonzero(fit & ~lanes.in_junction)

    def covered(self, participant: Participant, covers: Covers) -> SpawnSites:
        """Return the sites in an area at which a participant fits; closer ones if none of the usual ones is inside."""
        sites = self.for_body(participant)
        inside = sites.subset(covers(sites))
        if len(inside):
            return inside
        sites = SpawnSites.along(self._lanes, self._rows(walks=participant.walks), FINE_SPACING)
        return sites.subset(covers(sites))

    def for_body(self, participant: Participant) -> SpawnSites:
        """Return the sites at which a participant fits."""
        return self.walking if participant.walks else self.driving


def sites_within_radius(
    lanes: TrafficLanes, sites: SpawnSites, x: float, y: float, radius: float, location: LaneLocation | None
) -> SpawnSites:
    """Return the sites within a radius of a point [m], and the position of the point on its lane if it is a site lane.

    If there is none, return the nearest site within `REACH`.
    """
    distance = np.hypot(sites.x - x, sites.y - y)
    found = sites.subset(distance <= radius)
    if location is not None:
        row, progress = lanes.of(location)
        if np.any(sites.row == row):
            here = SpawnSites.at(lanes, np.array([row]), np.array([progress]))
            return found.concatenate(here)
    if not len(found) and len(sites) and distance.min() <= REACH:
        return sites.subset(np.array([int(np.argmin(distance))]))
    return found


def is_wide_enough(sites: SpawnSites, participant: Participant) -> Bools:
    """Return whether the lane at each site is wide enough for a participant."""
    width = participant.spec.size[1]
    return np.asarray(sites.width >= (width if participant.walks else min(width, WIDEST)))


def is_unoccupied(fleet: Fleet, sites: SpawnSites, participant: Participant, speed: Array, foreign: Array) -> Bools:
    """Return whether a participant can be spawned at each site with speeds (K,) [m/s].

    It must not overlap others, must need at most comfortable braking for its leader, and its follower likewise.
    foreign  (M, 7) boxes of all actors outside the fleet
    """
    lanes, spec, driver = fleet.lanes, participant.spec, participant.driver
    count = len(sites)
    half = 0.5 * spec.size[0]
    front, rear = np.full(count, spec.offset[0] + half), np.full(count, spec.offset[0] - half)
    occupants = fleet.occupants()
    no_owner = np.full(count, -9)
    leaders = find_leaders(lanes, lanes.chain(sites.row, PLANNED + 1), sites.progress, front, occupants, own=no_owner)
    followers = find_followers(lanes, sites.row, sites.progress, rear, occupants, no_owner)
    own = Drivers(np.repeat(Drivers.of([driver]).table, count, axis=0))
    braking = own.response(speed, np.maximum(speed, 1.0), leaders.gap, speed - leaders.speed)
    behind = followers.number
    known = (behind >= 0) & (occupants.owner[behind] > FOREIGN) if len(occupants.row) else behind >= 0
    table = np.repeat(Drivers.of([fleet.driver]).table, count, axis=0)
    table[known] = fleet.drivers.table[occupants.owner[behind[known]]]
    v = np.where(behind >= 0, occupants.speed[behind], 0.0) if len(occupants.row) else np.zeros(count)
    pressed = Drivers(table).response(v, np.maximum(v, 1.0), followers.gap, v - speed)
    fit = is_wide_enough(sites, participant) & (braking >= -driver.deceleration) & (leaders.gap > driver.standstill_gap)
    fit &= (behind < 0) | ((pressed >= -Drivers(table).deceleration) & (followers.gap > driver.standstill_gap))
    boxes = np.concatenate([foreign, fleet.boxes])
    for n in np.flatnonzero(fit).tolist():
        fit[n] = not _touches(sites, n, participant, boxes)
    return np.asarray(fit)


def _touches(sites: SpawnSites, n: int, participant: Participant, boxes: Array) -> bool:
    spec = participant.spec
    yaw = float(sites.heading[n])
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = sites.x[n] + cos * spec.offset[0], sites.y[n] + sin * spec.offset[0]
    reach = np.hypot(spec.size[0], spec.size[1]) / 2.0 + np.hypot(boxes[:, 3], boxes[:, 4]) / 2.0 + 2.0 * AIR
    for box in boxes[np.hypot(boxes[:, 0] - x, boxes[:, 1] - y) < reach].tolist():
        mine = (float(x), float(y), box[2], spec.size[0] + 2.0 * AIR, spec.size[1] + 2.0 * AIR, box[5], yaw)
        if overlap(mine, box):
            return True
    return False
