"""Search for the road and lane at world coordinates: nearest sample of a lane center, then Newton's method."""

from __future__ import annotations

from functools import cached_property
from itertools import chain

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers, number_in_groups
from eidrive_scenario.roads.geometry.nearest import NearestPoints
from eidrive_scenario.roads.geometry.poses import FAR, REFINEMENTS
from eidrive_scenario.roads.geometry.tables import RoadTables
from eidrive_scenario.roads.model.location import LaneLocations


class Overlaps:
    """Nearby roads of the same junction for points on connecting roads.

    points, road  (S, 2) and (S,) samples along the lanes of all roads; samples of a road are contiguous
    reach         maximum distance of a lane of a road from its nearest sample [m]
    """

    def __init__(self, tables: RoadTables, points: Array, road: Integers, reach: float) -> None:
        self._points, self._reach = points, reach
        count = len(tables.roads)
        self._first, self._last = np.searchsorted(road, [np.arange(count), np.arange(1, count + 1)])
        sampled = self._last > self._first
        junctions = [road.junction_id if has else None for road, has in zip(tables.roads, sampled, strict=True)]
        groups: dict[str | None, list[int]] = {}
        for index, junction in enumerate(junctions):
            groups.setdefault(junction, []).append(index)
        groups[None] = []
        others = [[n for n in groups[junction] if n != index] for index, junction in enumerate(junctions)]
        self._counts = np.array(list(map(len, others)), dtype=np.int64)
        self._starts = np.cumsum(self._counts) - self._counts
        self._others = np.array(list(chain.from_iterable(others)), dtype=np.int64)
        self._low, self._high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        np.minimum.at(self._low, road, points)
        np.maximum.at(self._high, road, points)

    def beneath(self, road: Integers, x: Array, y: Array) -> tuple[Integers, Integers]:
        """Return pairs for points (N,): point index and nearest sample of a nearby other road."""
        point, number = number_in_groups(self._counts[road])
        if not point.size:
            return point, point
        other = self._others[self._starts[road[point]] + number]
        px, py = x[point], y[point]
        low, high, reach = self._low[other], self._high[other], self._reach
        near = (px >= low[:, 0] - reach) & (px <= high[:, 0] + reach)
        near &= (py >= low[:, 1] - reach) & (py <= high[:, 1] + reach)
        point, other, px, py = point[near], other[near], px[near], py[near]
        if not point.size:
            return point, other
        first, sizes = self._first[other], self._last[other] - self._first[other]
        owner, number = number_in_groups(sizes)
        sample = first[owner] + number
        gap = (self._points[sample, 0] - px[owner]) ** 2 + (self._points[sample, 1] - py[owner]) ** 2
        least = np.minimum.reduceat(gap, sizes.cumsum() - sizes)
        # Ties select the first sample, as argmin does.
        at = (gap == least[owner]).nonzero()[0]
        at = at[owner[at].searchsorted(np.arange(len(point)))]
        close = least <= reach * reach
        return point[close], sample[at[close]]


SPACING = 4.0
"""Distance between samples along a lane [m]."""
NARROW = 1.0
"""Minimum width of a lane that gets samples [m]. Narrower lanes are located by their neighbors."""
CANDIDATES = 12
MANY = 1000
"""Minimum number of points that are sorted before the search."""
REACH = 30.0
"""Default maximum distance of a point from the road on which it is located [m]."""


class Locator:
    """Locator of points in road and lane coordinates.

    A point belongs to the road with the nearest lane center. If it is on none of the lanes of that road, the roads of
    the next samples are tried. The result is the road that contains the point, or else the nearest one.
    """

    def __init__(self, tables: RoadTables) -> None:
        self._tables = tables
        self._row, self._s = _samples(tables)
        poses = tables.lane_poses(self._row, self._s, np.zeros_like(self._s))
        self._road = tables.section_road[tables.lane_section[self._row]]
        self._frames = np.column_stack(self._frame(self._road, self._s))
        """Reference lines at the samples, with the columns of `_frame`."""
        self.sample_points: Array = np.column_stack([poses.x, poses.y])
        self._from_samples = tables.widest_lane + NARROW + SPACING
        """Maximum distance of a point on a road from the nearest of its samples [m]."""
        self._flat = NearestPoints(self.sample_points)
        self._solid = NearestPoints(np.column_stack([poses.x, poses.y, poses.z])) if np.any(poses.z != 0.0) else None

    def locate(self, x: Array, y: Array, z: Array | None, reach: float = REACH) -> LaneLocations:
        """Return road and lane coordinates of points (N,). Without z, the nearest road in plan view is selected."""
        samples, points, distance, nearest = self._nearest_samples(x, y, z, reach)
        count = len(points)
        if count <= MANY and distance.max(initial=0.0) < np.inf:
            return self._located(samples, points, nearest, reach)
        # Sorted points make the lookup in the tables faster.
        order = np.flatnonzero(distance < np.inf)
        order = order[np.argsort(nearest[order])]
        near = self._located(samples, points[order], nearest[order], reach)
        road, lane, outside = np.full(count, -1), np.zeros(count, dtype=np.int64), np.full(count, np.inf)
        s, t, offset, heading = np.zeros((4, count))
        locations = LaneLocations(self._tables.ids, road, lane, s, t, offset, heading, outside)
        locations.insert(near, order)
        return locations

    def _nearest_samples(
        self, x: Array, y: Array, z: Array | None, reach: float
    ) -> tuple[NearestPoints, Array, Array, Integers]:
        """Return the set of samples, the points in its coordinates, and distance and index of their nearest samples.

        The distance is inf for a point that is farther than `reach` from all roads.
        """
        if z is not None and self._solid is not None:
            samples, points, hopeless = self._solid, np.array([x, y, z]).T, np.inf
        else:
            # A point that is far from all samples is outside the reach of every road.
            samples, points, hopeless = self._flat, np.array([x, y]).T, reach + self._from_samples
        return samples, points, *samples.nearest(points, within=hopeless)

    def _located(self, samples: NearestPoints, points: Array, nearest: Integers, reach: float) -> LaneLocations:
        """Return locations of points (N, 2), or (N, 3) with heights, by the nearest samples of `samples`."""
        road, s, t, row, outside, _ = self._best_roads(samples, points, nearest, np.inf)
        heading = self._tables.curves.at(road, s)[2]
        far = outside > reach
        center, _ = self._tables.lane_t(row, s)
        return LaneLocations(
            roads=self._tables.ids,
            road=np.where(far, -1, road),
            lane=np.where(far, 0, self._tables.lane_id[row]),
            s=s,
            t=t,
            offset=t - center,
            heading=heading,
            outside=outside,
        )

    def _best_roads(
        self, samples: NearestPoints, points: Array, nearest: Integers, reach: float
    ) -> tuple[Integers, Array, Array, Integers, Array, Bools]:
        """Return roads, s, t, lane rows, distances from the road, and whether a further refinement has no effect.

        The result may be another road than the nearest one for a point farther than `reach` from all roads.
        """
        x, y, z = points[:, 0], points[:, 1], points[:, 2] if points.shape[1] > 2 else None
        road = self._road[nearest]
        s, t, beyond, settled = self._refine(road, self._s[nearest], x, y, self._frames_at(nearest))
        row, outside = self._tables.lane_beside(road, s, t)
        outside = np.hypot(outside, beyond)
        uncertain = (outside > 0.0).nonzero()[0]
        if uncertain.size and len(self._s) > 1:
            height = None if z is None else z[uncertain]
            limit = np.minimum(outside[uncertain], reach) + self._from_samples
            limit = limit if z is None else np.full(len(uncertain), np.inf)
            best = self._compare(samples, points[uncertain], x[uncertain], y[uncertain], height, limit)
            road[uncertain], s[uncertain], t[uncertain], row[uncertain], outside[uncertain] = best
            settled[uncertain] = False
        return road, s, t, row, outside, settled

    def overlapped_lanes(self, x: Array, y: Array, z: Array | None) -> tuple[Integers, Array, Integers]:
        """Return all lanes that overlap points (N,): lane rows, s on their roads, and indices of the points."""
        samples, places, distance, nearest = self._nearest_samples(x, y, z, reach=0.0)
        near = (distance < np.inf).nonzero()[0]
        road, s, _, row, outside, settled = self._best_roads(samples, places[near], nearest[near], reach=0.0)
        inside = (outside <= 0.0).nonzero()[0]
        on, road, s, row = near[inside], road[inside], s[inside], row[inside]
        pair, sample = self._overlaps.beneath(road, x[on], y[on])
        again = (~settled[inside]).nonzero()[0]
        if not again.size and not pair.size:
            return row, s, on
        frame = np.concatenate([self._frame(road[again], s[again]), self._frames_at(sample)], axis=1)
        points = np.concatenate([on, on[pair]])
        road, s = np.concatenate([road, self._road[sample]]), np.concatenate([s, self._s[sample]])
        row, hit = np.concatenate([row, pair]), np.ones(len(points), dtype=bool)
        # The lane rows of pairs are placeholders: all pairs are open.
        open_ = np.concatenate([again, np.arange(len(on), len(points))])
        at = points[open_]
        s[open_], t, beyond, _ = self._refine(road[open_], s[open_], x[at], y[at], frame)
        row[open_], outside = self._tables.lane_beside(road[open_], s[open_], t)
        hit[open_] = (beyond <= 0.0) & (outside <= 0.0)
        return row[hit], s[hit], points[hit]

    def roads_at(self, x: float, y: float) -> tuple[Integers, Array, Array]:
        """Return all roads that overlap a point in plan view, on all levels, with s and t there."""
        close = (((self.sample_points - (x, y)) ** 2).sum(axis=1) <= self._from_samples**2).nonzero()[0]
        road, at = self._road[close], np.ones(len(close))
        s, t, beyond, _ = self._refine(road, self._s[close], x * at, y * at, self._frames_at(close))
        on = (beyond <= 0.0) & (self._tables.lane_beside(road, s, t)[1] <= 0.0)
        road, s, t = road[on], s[on], t[on]
        # All samples of a road lead to one place, except where it passes above itself.
        _, first = np.unique(np.column_stack([road, s.round(3)]), axis=0, return_index=True)
        return road[first], s[first], t[first]

    def lane_gaps(self, x: float, y: float, lanes: Integers, within: float) -> tuple[Array, Array]:
        """Return distance in plan view and height of the nearest point of lanes, at least of those `within` [m].

        lanes  rows of the lanes
        """
        tables = self._tables
        gap = np.hypot(*(self.sample_points - (x, y)).T)
        near = (gap <= within + self._from_samples).nonzero()[0]
        near = near[np.argsort(gap[near], kind="stable")]
        section, first = np.unique(tables.lane_section[self._row[near]], return_index=True)
        sample, road, at = near[first], tables.section_road[section], np.ones(len(section))
        s, *_ = self._refine(road, self._s[sample], x * at, y * at, self._frames_at(sample))
        start = tables.section_start[section]
        s = np.clip(s, start, start + tables.section_length[section])
        px, py, cos, sin, *_ = self._frame(road, s)
        t = (cos * (y - py) - sin * (x - px)) / tables.lateral_axis(road, s)[1]
        lanes = lanes[np.isin(tables.lane_section[lanes], section)]
        of = section.searchsorted(tables.lane_section[lanes])
        s, t, half = s[of], t[of], 0.5 * tables.width.value(lanes, s[of] - start[of])
        wide = half > 0.0
        lanes, s, t, half = lanes[wide], s[wide], t[wide], half[wide]
        pose = tables.lane_poses(lanes, s, np.clip(t - tables.lane_t(lanes, s)[0], -half, half))
        return np.hypot(pose.x - x, pose.y - y), pose.z

    @cached_property
    def _overlaps(self) -> Overlaps:
        return Overlaps(self._tables, self.sample_points, self._road, self._from_samples)

    def _compare(
        self, samples: NearestPoints, points: Array, x: Array, y: Array, z: Array | None, limit: Array
    ) -> tuple[Integers, Array, Array, Integers, Array]:
        """Return the best road of the nearest samples: the one with the nearest surface.

        limit  (N,) distance of a sample from which on its road cannot be nearer than the best road so far [m]
        """
        k = min(CANDIDATES, len(self._s))
        distance, nearest = samples.several(points, k)
        road = self._road[nearest]
        earlier = np.tri(k, k=-1, dtype=bool)
        first = ~((road[:, :, None] == road[:, None, :]) & earlier).any(axis=2)
        first[:, 1:] &= distance[:, 1:] <= limit[:, None]
        point, column = np.nonzero(first)
        sample = nearest[point, column]
        road = self._road[sample]
        s, t, beyond, _ = self._refine(road, self._s[sample], x[point], y[point], self._frames_at(sample))
        row, outside = self._tables.lane_beside(road, s, t)
        outside = np.hypot(outside, beyond)
        score = outside
        if z is not None:
            score = outside + np.abs(z[point] - self._tables.road_poses(road, s, t).z)
        order = np.lexsort((column, score, point))
        best = order[np.searchsorted(point[order], np.arange(len(points)))]
        return road[best], s[best], t[best], row[best], outside[best]

    def _frame(self, road: Integers, s: Array) -> tuple[Array, ...]:
        """Return x, y, cosine and sine of the heading, curvature and path length per meter of s of reference lines."""
        x, y, h, curvature, speed = self._tables.curves.at(road, s)
        return x, y, np.cos(h), np.sin(h), curvature, speed

    def _frames_at(self, sample: Integers) -> Array:
        """Return `_frame` (6, N) at samples."""
        return self._frames.take(sample, axis=0).T

    def _refine(
        self, road: Integers, s: Array, x: Array, y: Array, frame: Array | tuple[Array, ...]
    ) -> tuple[Array, Array, Array, Bools]:
        """Return s, t and the distance beyond an end of the road as `project`, and whether s is a fixed point.

        s      (N,) initial values
        frame  `_frame` there
        """
        tables, length = self._tables, self._tables.length.take(road)
        end = length
        open_: Integers | None = None
        """Points whose s is not found yet; None for all."""
        refined_s, refined_t, refined_along, last_change = s, s, s, s
        low, high = np.full(len(s), -FAR), np.full(len(s), FAR)
        for repetition in range(REFINEMENTS):
            px, py, cos, sin, curvature, speed = frame if repetition == 0 else self._frame(road, s)
            dx, dy = x - px, y - py
            along, left = cos * dx + sin * dy, cos * dy - sin * dx
            t = left
            if tables.banked:
                ahead, level, _, _ = tables.lateral_axis(road, s)
                t = left / level
                along = along - t * ahead
                stretch = tables.stretch_at(road, s, t, curvature, speed)
            else:
                stretch = speed * (1.0 - curvature * left)
            moved = s + along / np.maximum(np.maximum(stretch, 0.2 * speed), 2e-4)
            is_between = (low < moved) & (moved < high)
            low, high = np.where(along > 0.0, s, low), np.where(along > 0.0, high, s)
            moved = np.where(is_between, moved, (low + high) / 2.0)
            moved = np.minimum(np.maximum(moved, 0.0), length)
            change = np.abs(moved - s)
            if open_ is None:
                refined_s, refined_t, refined_along, last_change = moved, t, along, change
            else:
                refined_s[open_], refined_t[open_], refined_along[open_], last_change[open_] = moved, t, along, change
            going = (change > 1e-6).nonzero()[0]
            if going.size == len(s):
                s = moved
                continue
            if not going.size:
                break
            open_ = going if open_ is None else open_[going]
            road, s, x, y, length = road[going], moved[going], x[going], y[going], length[going]
            low, high = low[going], high[going]
        beyond = np.zeros(len(end))
        at_end = ((refined_s <= 0.0) | (refined_s >= end)).nonzero()[0]
        if at_end.size:
            off = np.abs(refined_along[at_end])
            beyond[at_end] = np.where(off > 1e-6, off, 0.0)
        return refined_s, refined_t, beyond, last_change == 0.0


def _samples(tables: RoadTables) -> tuple[Integers, Array]:
    """Return lane rows and s of samples along all lanes of sufficient width and the widest lane of each section."""
    lanes = np.flatnonzero(tables.lane_id != 0)
    section = tables.lane_section[lanes]
    length = tables.section_length[section]
    width = np.max([tables.width.value(lanes, length * part) for part in (0.0, 0.5, 1.0)], axis=0)
    widest = np.full(len(tables.section_start), -np.inf)  # All lanes of a section may have negative widths
    np.maximum.at(widest, section, width)
    chosen = (width >= NARROW) | (width >= widest[section])
    lanes, length, section = lanes[chosen], length[chosen], section[chosen]
    counts = np.maximum(np.ceil(length / SPACING).astype(np.int64), 1) + 1
    lane, number = number_in_groups(counts)
    # The end of a section belongs to the next one; the sample is slightly inside.
    reach = np.maximum(length - 1e-6, 0.0)
    return lanes[lane], tables.section_start[section][lane] + reach[lane] * (number / (counts - 1)[lane])
