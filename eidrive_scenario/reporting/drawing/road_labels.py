"""Labels of roads in a picture: ids of roads and lanes, and marks of s along the reference lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import equidistant
from eidrive_scenario.reporting.drawing.canvas import Canvas
from eidrive_scenario.reporting.drawing.labels import write_labels
from eidrive_scenario.reporting.drawing.road_drawing import simplify_line
from eidrive_scenario.reporting.drawing.top_view import TRUTH, Window
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.road_map import Road

REFERENCE, ROAD = "#0e7490", "#7c2d12"
"""Colors of reference lines with their marks, and of the ids of roads."""
SPACING = 2.0
"""Distance of computed points of a reference line [m]."""
APART = 8.0
"""Minimum distance of the marks of s, in heights of a label."""
LANE_SIZE = 0.85
"""Size of the ids of lanes and of the values of s, in sizes of the label of an actor."""
LEAST_WIDTH = 1.15
"""Minimum width of a lane whose id is written, in heights of a label."""
TICK = 1.2
"""Length of a mark [m]."""


@dataclass(frozen=True)
class RoadLabels:
    """Labels of the roads of a network except those inside junctions, whose labels would cover each other."""

    network: RoadNetwork

    @cached_property
    def _lines(self) -> tuple[tuple[Road, Array, Array], ...]:
        """Road, s (N,) and points (N, 2) of each reference line [m]."""
        lines = []
        for road in self.network.roads.values():
            if road.junction_id is None:
                s = np.array(equidistant(0.0, road.length, SPACING))
                points = np.array([road.reference.at(at)[:2] for at in s.tolist()])
                if np.isfinite(points).all():
                    lines.append((road, s, points))
        return tuple(lines)

    def _visible(self, window: Window) -> Iterator[tuple[Road, Array, Array]]:
        """Yield road, s and points of the reference lines inside the section."""
        for road, s, points in self._lines:
            x, y = points.T
            inside = (window.left <= x) & (x <= window.right) & (window.bottom <= y) & (y <= window.top)
            if inside.any():
                yield road, s[inside], points[inside]

    def draw(self, canvas: Canvas) -> None:
        """Draw the reference lines with marks of s."""
        for _, _, points in self._lines:
            if canvas.window.reaches(points):
                canvas.line(simplify_line(points), REFERENCE, 0.0, legend="reference line with s [m]")
        for _, outline in self._marks(canvas):
            canvas.line(outline, REFERENCE, 0.0)

    def write(self, canvas: Canvas, taken: Array | tuple[()] = ()) -> None:
        """Write the ids of roads and lanes and the values of s where they do not cover others.

        The ids of lanes are in the lanes, or in one label beside a road whose lanes are too narrow for them.
        """
        lanes, lists = [], []
        least = LEAST_WIDTH * canvas.label_size("-1", LANE_SIZE)[1] / canvas.scale
        visible = list(self._visible(canvas.window))
        for road, s, _ in visible:
            longest: tuple[float, str, Array] = 0.0, "", np.empty((0, 2))
            for section in road.sections:
                within = s[(s >= section.s) & (s <= section.end)]
                if len(within) == 0:
                    continue
                # A quarter of the section, so that the id of the road has its place in the middle
                at = float(within[len(within) // 4])
                drivable = [lane for lane in section.lanes.values() if lane.drivable and lane.id != 0]
                for lane in section.lanes.values():
                    if lane.id != 0 and lane.width.value(at - section.s) >= least:
                        lanes.append((str(lane.id), self._lane_center(road, lane.id, at)[None]))
                if any(lane.width.value(at - section.s) < least for lane in drivable):
                    across = np.array([self._lane_center(road, lane.id, at) for lane in drivable])
                    ids = " ".join(str(lane.id) for lane in drivable)
                    longest = max(longest, (within[-1] - within[0], f"lanes {ids}", across), key=lambda entry: entry[0])
            lists.append(longest[1:])
        names = [(f"road {road.id}", points[len(points) // 2][None]) for road, _, points in visible]
        marks = [(f"s={s:g}", outline) for s, outline in self._marks(canvas)]
        for entries, color, size, inside in (
            (names, ROAD, 1.0, True),
            (lanes, TRUTH, LANE_SIZE, True),
            (lists, TRUTH, LANE_SIZE, False),
            (marks, REFERENCE, LANE_SIZE, False),
        ):
            if entries:
                texts, outlines = zip(*entries, strict=True)
                colors = [color] * len(texts)
                taken = write_labels(canvas, texts, outlines, taken, colors=colors, size=size, inside=inside)

    def _lane_center(self, road: Road, lane: int, s: float) -> Array:
        """Return the center of a lane [m]."""
        return np.array(self.network.lane_pose_at(road.id, lane, s)[:2])

    def _marks(self, canvas: Canvas) -> Iterator[tuple[float, Array]]:
        """Yield s and line (2, 2) [m] of each mark inside the section."""
        spacing = round_length(APART * max(canvas.label_size("s")[1], 1.0) / canvas.scale)
        for road, s, _ in self._visible(canvas.window):
            for at in np.arange(np.ceil(s[0] / spacing) * spacing, s[-1] + 1e-6, spacing).tolist():
                x, y, heading, *_ = road.reference.at(at)
                across = TICK / 2.0 * np.array([-np.sin(heading), np.cos(heading)])
                yield at, np.array([x, y]) + np.outer((-1.0, 1.0), across)


def round_length(length: float) -> float:
    """Return the smallest of 1, 2, 5, 10, … [m] from a length on."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= length * (1.0 - 1e-9)))
