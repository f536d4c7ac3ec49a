"""Caution before places that no sensor and no message covers: hidden traffic may come from there."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.planner_settings import REACTION
from eidrive_scenario.driving.planning.behavior.conflict_ways import UPSTREAM, ConflictWay
from eidrive_scenario.driving.planning.behavior.proposals import BEFORE_ZONE, Body, time_to_gain
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.road_objects import solid_boxes

CREEP = 1.39
"""Speed at which the vehicle moves on until it has a view [m/s], that of Autoware before occluded junctions."""
TARGET_HEIGHT = 1.0
"""Height at which hidden traffic is visible [m]."""
FAR = 100.0
"""Distance ahead within which ways are considered [m]."""


class Occluders(msgspec.Struct, frozen=True):
    """Bodies that block the view: N boxes with center, half length, half width and heading; height of the top [m]."""

    x: Array
    y: Array
    yaw: Array
    half_length: Array
    half_width: Array
    top: Array

    @classmethod
    def of_boxes(cls, boxes: Array) -> Occluders:
        """Return the occluders of boxes (N, 7)."""
        x, y, z, length, width, height, yaw = boxes.reshape(-1, 7).T
        return cls(x, y, yaw, length / 2.0, width / 2.0, z + height / 2.0)

    @classmethod
    def of_map(cls, roads: RoadNetwork) -> Occluders:
        """Return the buildings and solid objects of a map that are higher than hidden traffic."""
        return cls.of_boxes(solid_boxes(roads, TARGET_HEIGHT))

    def near(self, x: float, y: float, distance: float) -> Occluders:
        """Return those whose centers are within a distance of a place [m], plus their own extent."""
        reach = distance + np.hypot(self.half_length, self.half_width)
        rows = np.flatnonzero(np.hypot(self.x - x, self.y - y) <= reach)
        return Occluders(*(getattr(self, name)[rows] for name in self.__struct_fields__))

    def block(self, eye: ViewSector, points: Array, ground: float) -> Bools:
        """Return whether places (P, 2) are hidden from a sensor. A place inside a box is occupied, not hidden.

        ground  height of the ground at the places [m]
        """
        hidden = np.zeros(len(points), dtype=bool)
        if not len(self.x) or not len(points):
            return hidden
        cos, sin = np.cos(self.yaw)[:, None], np.sin(self.yaw)[:, None]
        ex, ey = eye.x - self.x[:, None], eye.y - self.y[:, None]
        px, py = points[None, :, 0] - self.x[:, None], points[None, :, 1] - self.y[:, None]
        entry, leave = np.zeros((len(self.x), len(points))), np.ones((len(self.x), len(points)))
        axes = (
            (cos * ex + sin * ey, cos * px + sin * py, self.half_length[:, None]),
            (cos * ey - sin * ex, cos * py - sin * px, self.half_width[:, None]),
        )
        for start, end, half in axes:
            step = end - start
            safe = np.where(np.abs(step) < 1e-9, 1e-9, step)
            first, second = (-half - start) / safe, (half - start) / safe
            entry, leave = np.maximum(entry, np.minimum(first, second)), np.minimum(leave, np.maximum(first, second))
        # The line of sight descends or rises from the sensor to the target; it is lowest in a box at one of the ends.
        height = ground + TARGET_HEIGHT - eye.z
        lowest = eye.z + height * (leave if height < 0.0 else entry)
        blocked = (entry < leave) & (leave < 1.0) & (entry > 0.0) & (lowest < self.top[:, None])
        return np.asarray(blocked.any(axis=0))


class PossibleTraffic:
    """Places of one way at which unseen traffic may be: set-based reachability.

    Traffic moves toward the zone with at most the speed of the way, may stand, and enters at the end of the way. What
    has been perceived to be free stays free until traffic can have come there.
    """

    def __init__(self) -> None:
        self._possible: Bools = np.zeros(0, dtype=bool)
        self._zone: Array | None = None
        """First place of the way, at the zone [m]."""
        self._time = 0.0
        self._moved = 0.0
        """Distance of the motion since the last place [m]."""

    def first(self, way: ConflictWay, shown: Bools, now: float) -> float:
        """Return the least distance from the zone at which traffic may be [m]; inf without a place.

        shown  places (P,) at which traffic would be perceived at `now` [s]
        """
        possible = self._from_zone(way)
        if len(possible) < len(shown):
            possible = np.concatenate([possible, np.ones(len(shown) - len(possible), dtype=bool)])
        self._moved += way.speed * max(now - self._time, 0.0)
        count = min(int(self._moved / way.spacing), len(shown))
        self._moved -= int(self._moved / way.spacing) * way.spacing
        self._time = now
        advanced = ~_clear_upstream(~possible[: len(shown)], count, beyond=False)
        needed = max(round(way.body / way.spacing), 1)
        self._possible = possible = _runs(advanced & ~shown, needed)
        if not possible.any():
            return math.inf
        return max(float(way.distance[int(possible.argmax())]) - self._moved, 0.0)

    def _from_zone(self, way: ConflictWay) -> Bools:
        """Return the places (P,) from the zone on: another line may meet the way at another place."""
        before, self._zone = self._zone, way.points[0]
        if before is None or len(way.points) < 2:
            return self._possible
        upstream = (way.points[1] - way.points[0]) / way.spacing
        moved = round(float((way.points[0] - before) @ upstream) / way.spacing)
        return self._possible[moved:] if moved >= 0 else np.concatenate([np.ones(-moved, dtype=bool), self._possible])


class HiddenTraffic:
    """Speed limits before the ways on which unseen traffic may come.

    The vehicle approaches such a way so that it can stop before the zone, and creeps on until its sensor is at the
    zone. Then it drives on, and reacts to what it detects.

    fixed  occluders of the map;  view  sectors of the sensors of the vehicle
    range  assumed range of sensors without a limit [m]
    """

    def __init__(
        self,
        settings: BehaviorSettings,
        fixed: Occluders,
        body: Body,
        view: Sequence[ViewSector],
        range: float,
    ) -> None:
        self._settings = settings
        self._fixed = fixed
        self._body = body
        self._sensor = max((sector.x for sector in view), default=body.center)
        self._range = range
        self._traffic: dict[Hashable, PossibleTraffic] = {}

    def limits(
        self,
        ways: Sequence[ConflictWay],
        along: Array,
        motion: tuple[float, float, float],
        position: tuple[float, float, float],
        regions: Sequence[PerceptionRegion],
        objects: Detections,
        now: float,
    ) -> tuple[Array, str] | None:
        """Return speed limits (M,) at distances along the line [m/s] and the way that is hidden; None without one.

        motion    distance of the vehicle along the line [m], its speed and its wanted speed [m/s]
        position  of the vehicle; its height is that of the ground [m]
        """
        s, speed, wanted = motion
        # Of a way that the line meets several times only the first meeting ahead.
        ahead = {way.key: way for way in reversed(ways) if s + self._sensor < way.look and way.hold < s + FAR}
        if not ahead:
            return None
        x, y, ground = position
        seen = Occluders.of_boxes(objects.boxes)
        fixed = self._fixed.near(x, y, FAR + UPSTREAM)
        occluders = [group for group in (seen, fixed) if len(group.x)]
        lowest: Array | None = None
        nearest = (math.inf, "")
        for way in ahead.values():
            shown = self._shown(way, regions, occluders, ground, now)
            hidden = self._traffic.setdefault(way.key, PossibleTraffic()).first(way, shown, now)
            # Until the rear of the vehicle has left the zone.
            time = time_to_gain(way.end + self._body.rear - s, speed, wanted, self._settings.acceleration)
            if hidden / way.speed > time:
                continue
            stop = way.hold - self._body.front - BEFORE_ZONE
            limits = np.where(along > way.look - self._sensor, math.inf, self.safe_speed(stop - along))
            lowest = limits if lowest is None else np.minimum(lowest, limits)
            nearest = min(nearest, (way.start, way.kind))
        return None if lowest is None else (lowest, nearest[1])

    def safe_speed(self, distance: Array) -> Array:
        """Return the speeds from which the vehicle stops within distances after its reaction [m/s], at least creeping.

        v = -bt + √(b²t² + 2bd)
        """
        b, t = self._settings.comfortable_deceleration, REACTION
        speed = -b * t + np.sqrt((b * t) ** 2 + 2.0 * b * np.maximum(distance, 0.0))
        return np.maximum(speed, CREEP)

    def _shown(
        self,
        way: ConflictWay,
        regions: Sequence[PerceptionRegion],
        occluders: Sequence[Occluders],
        ground: float,
        now: float,
    ) -> Bools:
        """Return the places of a way (P,) at which traffic would be perceived now."""
        clear = np.zeros(len(way.points), dtype=bool)
        for region in regions:
            shown = np.zeros(len(way.points), dtype=bool)
            for sector in region.sectors:
                eye = sector if math.isfinite(sector.range) else msgspec.structs.replace(sector, range=self._range)
                inside = eye.contains(way.points[:, 0], way.points[:, 1])
                for group in occluders:
                    inside &= ~group.block(eye, way.points, ground)
                shown |= inside
            # During the age of the measurement traffic may have come from the places upstream.
            moved = math.ceil(way.speed * max(now - region.time, 0.0) / way.spacing)
            clear |= _clear_upstream(shown, moved)
        return clear


def _runs(places: Bools, count: int) -> Bools:
    """Return the places (P,) that belong to at least `count` consecutive ones; there are more beyond the last one."""
    if count <= 1:
        return places
    longer = np.concatenate([places, np.ones(count - 1, dtype=bool)])
    starts = np.convolve(longer, np.ones(count), mode="valid") == count
    return np.asarray(np.convolve(starts, np.ones(count)) > 0.0)[: len(places)]


def _clear_upstream(clear: Bools, count: int, *, beyond: bool = True) -> Bools:
    """Return the places (P,) that are clear with the next `count` places upstream.

    beyond  whether the places beyond the last one are clear
    """
    if count <= 0:
        return clear
    longer = np.concatenate([clear, np.full(count, beyond)])
    return np.asarray(np.convolve(~longer, np.ones(count + 1), mode="valid") == 0.0)
