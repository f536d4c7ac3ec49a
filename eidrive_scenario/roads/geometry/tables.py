"""All roads of a network as flat arrays, for poses at coordinates on any mixture of roads."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.roads.geometry.poses import BEYOND, LEAST_STRETCH, lane_height, off_road
from eidrive_scenario.roads.model.curve_table import CurveTable
from eidrive_scenario.roads.model.location import LaneKey, Poses, PositionError
from eidrive_scenario.roads.model.polynomials import PolynomialTable
from eidrive_scenario.roads.model.road_map import AT_END, STEP, Road


class RoadTables:
    """Roads by their index in `ids`; lane sections and lanes by running numbers over all roads.

    The lanes of a section are in the order 0, 1, 2, … -1, -2, …
    """

    def __init__(self, roads: Sequence[Road]) -> None:
        self.roads = list(roads)
        self.by_id = {road.id: road for road in roads}
        self.ids = list(self.by_id)
        self.index = {number: index for index, number in enumerate(self.ids)}
        self.length = np.array([road.length for road in roads])
        spans = [road.length for road in roads]
        self.curves = CurveTable([road.reference for road in roads])
        self.elevation = PolynomialTable([road.elevation for road in roads], spans)
        self.superelevation = PolynomialTable([road.superelevation for road in roads], spans)
        self.banked = not self.superelevation.is_zero
        """Whether any road has a superelevation."""
        self.lane_offset = PolynomialTable([road.lane_offset for road in roads], spans)
        self._index_sections()

    def _index_sections(self) -> None:
        owners = [(index, section) for index, road in enumerate(self.roads) for section in road.sections]
        sections = [section for _, section in owners]
        self.section_road = np.array([index for index, _ in owners], dtype=np.int64)
        self.section_start = np.array([section.s for section in sections])
        self.section_length = np.array([section.length for section in sections])
        self.first_section = np.searchsorted(self.section_road, np.arange(len(self.roads)))
        self._section_borders = (self.curves.base[self.section_road] + self.section_start)[1:]
        """Starts of all sections but the first one, on the common axis of all roads."""
        # Lanes from the middle outwards, first those on the left
        inside_out = [
            [section.lanes[number] for number in sorted(section.lanes, key=lambda n: (n < 0, abs(n)))]
            for section in sections
        ]
        counts = np.array([len(lanes) for lanes in inside_out])
        self.left_count = np.array([sum(1 for lane in lanes if lane.id > 0) for lanes in inside_out])
        self.right_count = counts - self.left_count - 1
        self.first_lane = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
        self._sides = self._index_sides()
        """First and last lane on the right and on the left of each section: rows 2·section and 2·section + 1. On a
        side without lanes the last one is -1, the first one is on the other side if there is any."""
        self.lanes = lanes = [lane for group in inside_out for lane in group]
        self._lifted = np.array([bool(lane.heights) for lane in lanes])
        self.lane_section = np.repeat(np.arange(len(sections)), counts)
        self.lane_id = np.array([lane.id for lane in lanes], dtype=np.int64)
        self.lane_drivable = np.array([lane.drivable for lane in lanes])
        spans = [section.length for section, group in zip(sections, inside_out, strict=True) for _ in group]
        self.center = PolynomialTable([lane.center for lane in lanes], spans)
        self.outer = PolynomialTable([lane.outer for lane in lanes], spans)
        self.width = PolynomialTable([lane.width for lane in lanes], spans)

    def _index_sides(self) -> Integers:
        inner, left, right = self.first_lane, self.left_count, self.right_count
        counts = np.column_stack([right, left]).ravel()
        first = np.column_stack([inner + 1 + left, inner + 1]).ravel()
        any_lane = (inner + np.where(left + right > 0, 1, 0)).repeat(2)
        return np.column_stack([np.where(counts > 0, first, any_lane), np.where(counts > 0, first + counts - 1, -1)])

    @cached_property
    def widest_lane(self) -> float:
        """Maximum width of any lane at its start, middle and end [m]."""
        lanes = np.arange(len(self.lane_id))
        length = self.section_length[self.lane_section]
        widths = [self.width.value(lanes, length * part).max(initial=0.0) for part in (0.0, 0.5, 1.0)]
        return float(max(widths))

    def section_of(self, road: Integers, s: Array) -> Integers:
        """Return the running number of the lane section at s (N,) of roads (N,)."""
        keys = self.curves.base.take(road) + s
        section: Integers = self._section_borders.searchsorted(keys, side="right")
        first: Integers = self.first_section.take(road)
        return np.maximum(section, first)

    def lane_row(self, road: Integers, s: Array, lane: Integers) -> Integers:
        """Return the running numbers of lanes by their id (N,) at s (N,). Raise PositionError if one does not exist."""
        section = self.section_of(road, s)
        left, right = self.left_count[section], self.right_count[section]
        row = self.first_lane[section] + np.where(lane >= 0, np.minimum(lane, left), left + np.minimum(-lane, right))
        invalid = self.lane_id[row] != lane
        for n in np.flatnonzero(invalid):
            # Gaps in lane ids violate the standard but occur, so that lanes are found by id.
            end = self.first_lane[section[n]] + left[n] + right[n] + 1
            near = np.flatnonzero(self.lane_id[self.first_lane[section[n]] : end] == lane[n])
            if not near.size:
                message = f"road {self.ids[road[n]]!r} has no lane {lane[n]} at s = {s[n]:g} m"
                raise PositionError(Diagnostic(message, "correct the lane"))
            row[n] = self.first_lane[section[n]] + near[0]
        return np.asarray(row, dtype=np.int64)

    def row_of(self, key: LaneKey) -> int:
        """Return the running number of a lane of a lane section. Raise KeyError if it does not exist."""
        return self._rows[key]

    @cached_property
    def lane_keys(self) -> list[LaneKey]:
        """All lanes, by their running numbers."""
        keys = []
        for section, lane in zip(self.lane_section.tolist(), self.lane_id.tolist(), strict=True):
            road = int(self.section_road[section])
            keys.append(LaneKey(self.ids[road], section - int(self.first_section[road]), lane))
        return keys

    @cached_property
    def _rows(self) -> dict[LaneKey, int]:
        return {key: row for row, key in enumerate(self.lane_keys)}

    def check(self, road: Integers, s: Array) -> None:
        """Raise PositionError for the first position beyond the ends of its road."""
        invalid = np.flatnonzero((s < -BEYOND) | (s > self.length[road] + BEYOND))
        if invalid.size:
            first = invalid[0]
            raise off_road(self.roads[road[first]], float(s[first]))

    def road_poses(self, road: Integers, s: Array, t: Array) -> Poses:
        """Return the poses at road coordinates (N,) with the headings of the reference lines."""
        x, y, h, _, _ = self.curves.at(road, s)
        z, slope = self.elevation.value_and_slope(road, s)
        pitch = -np.arctan(slope)
        sin, cos = np.sin(h), np.cos(h)
        if not self.banked:
            t = t + np.zeros_like(s)
            return Poses(x - t * sin, y + t * cos, z + np.zeros_like(t), h, pitch, np.zeros_like(s))
        ahead, left, up, roll = self.lateral_axis(road, s)
        ahead, left = t * ahead, t * left
        return Poses(x + ahead * cos - left * sin, y + ahead * sin + left * cos, z + t * up, h, pitch, roll)

    def lateral_axis(self, road: Integers, s: Array) -> tuple[Array, Array, Array, Array]:
        """Return the unit vectors of the t-axes (ahead, left, up) and the superelevation [rad], each (N,)."""
        slope = self.elevation.value_and_slope(road, s)[1]
        roll = self.superelevation.value(road, s)
        steep, sin = np.hypot(1.0, slope), np.sin(roll)
        return -sin * slope / steep, np.cos(roll), sin / steep, roll

    def lane_poses(self, row: Integers, s: Array, offset: Array) -> Poses:
        """Return the poses at the center lines of lanes (running numbers) plus offset, as `poses.lane_pose_at` does."""
        section = self.lane_section[row]
        road = self.section_road[section]
        t, sideways = self.lane_t(row, s)
        t = t + offset
        x, y, h, curvature, speed = self.curves.at(road, s)
        if self.banked:
            ahead, left, z, along, sideways, climb, roll = self._banked_tangent(road, s, t, sideways, curvature, speed)
        else:
            z, climb = self.elevation.value_and_slope(road, s)
            ahead, left, along = np.zeros_like(t), t, np.maximum(speed * (1.0 - curvature * t), LEAST_STRETCH)
            length = np.sqrt(along * along + sideways * sideways + climb * climb)
            roll = np.arctan2(-climb * sideways, along * length) + 0.0
        for n in np.flatnonzero(self._lifted[row]):
            z[n] += lane_height(self.lanes[row[n]], float(s[n] - self.section_start[section[n]]), float(offset[n]))
        sin, cos = np.sin(h), np.cos(h)
        return Poses(
            x + ahead * cos - left * sin,
            y + ahead * sin + left * cos,
            z,
            h + np.arctan2(sideways, along),
            -np.arctan2(climb, np.hypot(along, sideways)),
            roll,
        )

    def _banked_tangent(
        self, road: Integers, s: Array, t: Array, sideways: Array, curvature: Array, speed: Array
    ) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
        """Return `poses.banked_tangent` for arrays."""
        z, slope, bend = self.elevation.to_second_order(road, s)
        roll, twist = self.superelevation.value_and_slope(road, s)
        sin, cos = np.sin(roll), np.cos(roll)
        square = 1.0 + slope * slope
        level = 1.0 / np.sqrt(square)
        steep, steeper = slope * level, bend * level / square
        rise = sideways * sin + t * cos * twist
        ahead, left = -t * sin * steep, t * cos
        along = speed * (1.0 - curvature * left) - rise * steep - t * sin * steeper
        along = np.maximum(along, LEAST_STRETCH)
        lateral = sideways * cos - t * sin * twist + curvature * speed * ahead
        climb = slope + rise * level - t * sin * slope * steeper
        nx, ny = lateral * sin * level - climb * cos, -climb * sin * steep - along * sin * level
        nz = along * cos + lateral * sin * steep
        lean = np.arctan2(nx * lateral - ny * along, nz * np.sqrt(along * along + lateral * lateral + climb * climb))
        return ahead, left, z + t * sin * level, along, lateral, climb, lean

    def stretch_at(self, road: Integers, s: Array, t: Array, curvature: Array, speed: Array) -> Array:
        """Return the meters ahead per meter of s at constant t (N,) on roads with superelevation."""
        return self._banked_tangent(road, s, t, np.zeros_like(s), curvature, speed)[3]

    def stretch(self, row: Integers, s: Array) -> Array:
        """Return the path length per meter of s along the center lines of lanes in plan view."""
        t, slope = self.lane_t(row, s)
        road = self.section_road[self.lane_section[row]]
        *_, curvature, speed = self.curves.at(road, s)
        return np.asarray(np.maximum(np.hypot(speed * (1.0 - curvature * t), slope), LEAST_STRETCH))

    def lane_t(self, row: Integers, s: Array) -> tuple[Array, Array]:
        """Return t of the center lines of lanes and its derivative, as `poses.lane_t` and `Road.lane_offset_in`."""
        section = self.lane_section[row]
        road = self.section_road[section]
        t, slope = self.lane_offset.value_and_slope(road, s)
        at_end = s >= self.section_start[section] + self.section_length[section] - AT_END
        if at_end.any():
            before, slope_before = self.lane_offset.value_and_slope(road, s - AT_END)
            steps = at_end & (np.abs(before - t) > STEP)
            t, slope = np.where(steps, before, t), np.where(steps, slope_before, slope)
        center, center_slope = self.center.value_and_slope(row, s - self.section_start[section])
        side = np.sign(self.lane_id[row])
        return t + side * center, slope + side * center_slope

    def lane_beside(self, road: Integers, s: Array, t: Array) -> tuple[Integers, Array]:
        """Return running numbers of lanes at road coordinates and distances from the road edge, 0 on the road."""
        section = self.section_of(road, s)
        ds = s - self.section_start.take(section)
        offset = t - self.lane_offset.value(road, s)
        row, last = self._sides.take(2 * section + (offset > 0.0), axis=0).T
        reach = np.abs(offset)
        has_lanes = last >= 0
        outside = np.where(has_lanes, 0.0, reach)
        open_ = has_lanes.nonzero()[0]
        while open_.size:
            lane = row[open_]
            over = reach[open_] - self.outer.value(lane, ds[open_])
            beyond = (over >= 0.0).nonzero()[0]
            open_, lane, over = open_[beyond], lane[beyond], over[beyond]
            ends = lane >= last[open_]
            outside[open_[ends]] = over[ends]
            open_ = open_[~ends]
            row[open_] += 1
        return row, outside
