"""Areas of traffic (polygons, and ranges of roads between cursors), sites for spawning, and whether they are free."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers, number_in_groups
from eidrive_scenario.base.car_following import Drivers
from eidrive_scenario.base.geometry import overlap, points_in_polygon
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.roads.model.location import PositionError
from eidrive_scenario.roads.routing.links import RoadEnd
from eidrive_scenario.traffic.cars import PLANNED
from eidrive_scenario.traffic.fleet import Fleet
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FIXED, FOREIGN, Leaders, find_followers, find_leaders
from eidrive_scenario.traffic.occupancy import TALLEST
from eidrive_scenario.traffic.right_of_way import STOP_LINE, TOO_LATE
from eidrive_scenario.traffic.spawning.bodies import Participant

if TYPE_CHECKING:
    import networkx as nx

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
ROUNDING = 1e-6
"""Reduction of a comfortable speed, so that rounding does not make its braking more than comfortable [m/s]."""
_NOBODY = -9
"""Index in the fleet of a participant that is not in it."""


@dataclass(frozen=True)
class SpawnSites:
    """Sites (K,): lane and progress, x, y, z [m], heading of the traffic [rad], width of the lane [m]."""

    lane: Integers
    progress: Array
    x: Array
    y: Array
    z: Array
    heading: Array
    width: Array

    @classmethod
    def along(cls, lanes: TrafficLanes, selected: Integers, spacing: float = SPACING) -> SpawnSites:
        """Return equidistant sites along lanes."""
        counts = np.maximum(np.floor(lanes.length[selected] / spacing).astype(np.int64), 1)
        group, number = number_in_groups(counts)
        lane = selected[group]
        return cls.at(lanes, lane, (number + 0.5) * lanes.length[lane] / counts[group])

    @classmethod
    def at(cls, lanes: TrafficLanes, lane: Integers, progress: Array) -> SpawnSites:
        """Return sites (K,) at given lanes and progress."""
        poses = lanes.tables.lane_poses(lane, lanes.s(lane, progress), np.zeros(len(lane)))
        heading = poses.h + np.where(lanes.direction[lane] > 0, 0.0, np.pi)
        return cls(lane, progress, poses.x, poses.y, poses.z, heading, lanes.width(lane, progress))

    def __len__(self) -> int:
        return len(self.lane)

    def subset(self, which: Integers | Bools) -> SpawnSites:
        """Return a subset of the sites."""
        return SpawnSites(*(column[which] for column in vars(self).values()))

    def concatenate(self, other: SpawnSites) -> SpawnSites:
        """Return the union of the sites."""
        return SpawnSites(*map(np.concatenate, zip(vars(self).values(), vars(other).values(), strict=True)))


Covers = Callable[[SpawnSites], Bools]
"""Test whether each site is inside an area."""


class SpawnAreas:
    """Sites of one road network for vehicles and pedestrians."""

    def __init__(self, lanes: TrafficLanes) -> None:
        self._lanes = lanes

    @cached_property
    def driving(self) -> SpawnSites:
        """Sites for vehicles, without lanes that end."""
        return SpawnSites.along(self._lanes, self._lanes_for(walks=False))

    @cached_property
    def walking(self) -> SpawnSites:
        """Sites for pedestrians."""
        return SpawnSites.along(self._lanes, self._lanes_for(walks=True))

    def _lanes_for(self, *, walks: bool) -> Integers:
        lanes = self._lanes
        fit = lanes.walkable if walks else lanes.tables.lane_drivable & np.isinf(lanes.ends_at)
        return np.flatnonzero(fit & ~lanes.in_junction)

    def covered(self, participant: Participant, covers: Covers) -> SpawnSites:
        """Return the sites in an area at which a participant fits; closer ones if none of the usual ones is inside."""
        sites = self.for_body(participant)
        inside = sites.subset(covers(sites))
        if len(inside):
            return inside
        sites = SpawnSites.along(self._lanes, self._lanes_for(walks=participant.walks), FINE_SPACING)
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
    near = sites.subset(distance <= radius)
    if location is not None:
        lane, progress = lanes.of(location)
        if np.any(sites.lane == lane):
            here = SpawnSites.at(lanes, np.array([lane]), np.array([progress]))
            return near.concatenate(here)
    if not len(near) and len(sites) and distance.min() <= REACH:
        return sites.subset(np.array([int(np.argmin(distance))]))
    return near


def is_wide_enough(sites: SpawnSites, participant: Participant) -> Bools:
    """Return whether the lane at each site is wide enough for a participant."""
    width = participant.spec.size[1]
    return np.asarray(sites.width >= (width if participant.walks else min(width, WIDEST)))


def leaders_ahead(fleet: Fleet, sites: SpawnSites, participant: Participant) -> Leaders:
    """Return the leaders of a participant at each site."""
    lanes, front = fleet.lanes, np.full(len(sites), participant.front)
    chain = lanes.chain(sites.lane, PLANNED + 1)
    return find_leaders(lanes, chain, sites.progress, front, fleet.occupants(), own=np.full(len(sites), _NOBODY))


def comfortable_speeds(lanes: TrafficLanes, sites: SpawnSites, participant: Participant, leaders: Leaders) -> Array:
    """Return the maximum speeds (K,) from which a participant brakes comfortably for its leader [m/s].

    A vehicle can also stop before the next junction as for a light that changes: it has no right of way yet.
    """
    driver = participant.driver
    # The model brakes with b where s0 + v T + v (v - v_leader) / c = gap sqrt(b / a), and c = 2 sqrt(a b)
    c = 2.0 * math.sqrt(driver.acceleration * driver.deceleration)
    free = leaders.gap * math.sqrt(driver.deceleration / driver.acceleration) - driver.standstill_gap
    half = 0.5 * (leaders.speed - c * driver.time_gap)
    speed = half + np.sqrt(half**2 + c * np.maximum(free, 0.0))
    if not participant.walks:
        stop = lanes.to_junction(sites.lane, sites.progress) - participant.front - STOP_LINE
        speed = np.minimum(speed, np.sqrt(2.0 * TOO_LATE * np.maximum(stop, 0.0)))
    return np.asarray(np.maximum(speed - ROUNDING, 0.0))


def is_unoccupied(
    fleet: Fleet, sites: SpawnSites, participant: Participant, speed: Array, leaders: Leaders, foreign: Array
) -> Bools:
    """Return whether a participant can be spawned at each site with speeds (K,) [m/s].

    It must not overlap others, must need at most comfortable braking for its leader, and its follower likewise.
    foreign  (M, 7) boxes of all actors outside the fleet
    """
    lanes, spec, driver = fleet.lanes, participant.spec, participant.driver
    count, occupants = len(sites), fleet.occupants().without(FIXED)
    rear = np.full(count, participant.front - spec.size[0])
    followers = find_followers(lanes, sites.lane, sites.progress, rear, occupants, np.full(count, _NOBODY))
    own = Drivers(np.repeat(Drivers.of([driver]).table, count, axis=0))
    braking = own.response(speed, np.maximum(speed, 1.0), leaders.gap, speed - leaders.speed)
    behind = followers.number
    own_driver = (behind >= 0) & (occupants.owner[behind] > FOREIGN) if len(occupants.lane) else behind >= 0
    table = np.repeat(Drivers.of([fleet.driver]).table, count, axis=0)
    table[own_driver] = fleet.drivers.table[occupants.owner[behind[own_driver]]]
    v = np.where(behind >= 0, occupants.speed[behind], 0.0) if len(occupants.lane) else np.zeros(count)
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
    z = float(sites.z[n]) + 0.5 * TALLEST
    reach = np.hypot(spec.size[0], spec.size[1]) / 2.0 + np.hypot(boxes[:, 3], boxes[:, 4]) / 2.0 + 2.0 * AIR
    for box in boxes[np.hypot(boxes[:, 0] - x, boxes[:, 1] - y) < reach].tolist():
        mine = (float(x), float(y), z, spec.size[0] + 2.0 * AIR, spec.size[1] + 2.0 * AIR, TALLEST, yaw)
        if overlap(mine, box):
            return True
    return False


@dataclass(frozen=True)
class Cursor:
    """Cross section of a road at s [m]; s is None for the start or end of the road; lanes () for all lanes."""

    road: str
    s: float | None = None
    lanes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Stretch:
    """Part of a road from `low` to `high` [m]; lanes () for all lanes."""

    road: str
    low: float
    high: float
    lanes: tuple[int, ...] = ()


def polygon(corners: Sequence[tuple[float, float]]) -> Covers:
    """Return a test whether sites are inside a polygon."""
    outline = np.array(corners)
    return lambda sites: points_in_polygon(np.column_stack([sites.x, sites.y]), outline)


def stretches_cover(lanes: TrafficLanes, stretches: Sequence[Stretch]) -> Covers:
    """Return a test whether sites are on one of several parts of roads."""

    def covers(sites: SpawnSites) -> Bools:
        covered = np.zeros(len(sites), dtype=bool)
        s, road, number = lanes.s(sites.lane, sites.progress), lanes.road[sites.lane], lanes.tables.lane_id[sites.lane]
        for stretch in stretches:
            here = (road == lanes.tables.index[stretch.road]) & (s >= stretch.low) & (s <= stretch.high)
            covered |= here & np.isin(number, stretch.lanes) if stretch.lanes else here
        return covered

    return covers


def road_range(roads: RoadNetwork, cursors: Sequence[Cursor], length: float | None = None) -> list[Stretch]:
    """Return the parts of roads from the first cursor over the others to the last one.

    The lanes of a cursor are valid up to the next cursor. Between cursors on different roads the range follows the
    shortest chain of linked roads with all their lanes. `length` truncates the range from the first cursor on [m].
    Raise PositionError if a road does not exist or the roads are not linked.
    """
    links = _links(roads)
    parts: list[tuple[Stretch, bool]] = []
    for number, (start, end) in enumerate(pairwise(cursors)):
        first, last = roads.road(start.road).length, roads.road(end.road).length
        here = start.s if start.s is not None else 0.0 if number == 0 else first
        there = end.s if end.s is not None else last
        if start.road == end.road:
            parts.append((Stretch(start.road, min(here, there), max(here, there), start.lanes), there >= here))
            continue
        chain = _chain(links, start.road, end.road)
        leaving, *between, entering = chain
        forward = leaving.side > 0
        if start.s is None and number == 0 and not forward:
            here = first
        parts.append((Stretch(start.road, here if forward else 0.0, first if forward else here, start.lanes), forward))
        for road_end in between[::2]:
            whole = roads.road(road_end.road).length
            parts.append((Stretch(road_end.road, 0.0, whole), road_end.side < 0))
        forward = entering.side < 0
        if end.s is None and number == len(cursors) - 2 and not forward:
            there = 0.0
        parts.append((Stretch(end.road, 0.0 if forward else there, there if forward else last, end.lanes), forward))
    return _cut(parts, length)


def _cut(parts: Sequence[tuple[Stretch, bool]], length: float | None) -> list[Stretch]:
    cut, left = [], np.inf if length is None else length
    for stretch, forward in parts:
        span = min(stretch.high - stretch.low, left)
        low = stretch.low if forward else stretch.high - span
        cut.append(Stretch(stretch.road, low, low + span, stretch.lanes))
        left -= span
        if left <= 0.0:
            break
    return cut


def _links(roads: RoadNetwork) -> nx.DiGraph[RoadEnd]:
    """Return the ends at which roads are left, with edges over linked roads and the lengths of these."""
    import networkx as nx

    links: nx.DiGraph[RoadEnd] = nx.DiGraph()
    links.add_nodes_from(RoadEnd(road, side) for road in roads.roads for side in (1, -1))
    for lane, successor, edge in roads.graph.edges(data=True):
        if edge["kind"] == "successor" and lane.road != successor.road:
            leaving = RoadEnd(lane.road, roads.driving_direction(lane.road, lane.lane))
            entering = RoadEnd(successor.road, -roads.driving_direction(successor.road, successor.lane))
            for a, b in ((leaving, entering), (entering, leaving)):
                links.add_edge(a, RoadEnd(b.road, -b.side), length=roads.road(b.road).length)
    return links


def _chain(links: nx.DiGraph[RoadEnd], start: str, goal: str) -> list[RoadEnd]:
    """Return the road ends from the exit of `start` to the entry of `goal`; roads between have two consecutive ends.

    Their total length is minimal.
    """
    import networkx as nx

    paths = nx.multi_source_dijkstra_path(links, [RoadEnd(start, side) for side in (1, -1)], weight="length")
    reaching = [paths[end] for end in (RoadEnd(goal, 1), RoadEnd(goal, -1)) if end in paths]
    if not reaching:
        message = f"no chain of roads leads from road {start!r} to road {goal!r}"
        raise PositionError(Diagnostic(message, "correct the road cursors"))
    first, *exits = min(reaching, key=lambda path: nx.path_weight(links, path, weight="length"))
    return [first, *(end for out in exits for end in (RoadEnd(out.road, -out.side), out))][:-1]
