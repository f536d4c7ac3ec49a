"""Road marks as painted strips along lane edges, and painted areas."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road, RoadMark
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.objects import outlines

DASH, GAP = 3.0, 6.0
"""Length of dash and gap of broken lines in built-up areas [m], by the German RMS."""
APART = 0.24
"""Distance between the center lines of a double line [m]."""
STRIPE = 0.5
"""Width of the stripes of a crosswalk and of the gaps between them [m]."""
MOST_STRIPES = 500
"""Maximum number of stripes of a crosswalk."""
MOST_DASHES = 20_000
"""Maximum number of dashes of a line. A line with more dashes is drawn solid."""
FINEST = 0.01
"""Minimum length of dash and gap together [m]. Shorter patterns are drawn solid."""
PAINTED = ("solid", "broken", "solid solid", "solid broken", "broken solid", "broken broken", "botts dots")
CURVED = 0.01
"""Minimum curvature at which a dash is drawn bent [1/m]."""


class Strip(NamedTuple):
    """Paint along a road: `s` and `t` (K, P) of K pieces with P points each, and `width` [m]."""

    kind: str
    s: Array
    t: Array
    width: float


def lane_strips(road: Road, section: LaneSection, cuts: Array) -> Iterator[Strip]:
    """Yield the marks of a lane section. Solid lines may bend at the values of s in `cuts`."""
    for lane in section.lanes.values():
        if road.junction_id is not None and lane.type == "none" and lane.id:
            continue
        marks = lane.road_marks
        for mark, following in zip(marks, (*marks[1:], None), strict=False):
            start = section.s + max(mark.s_offset, 0.0)
            end = section.end if following is None else min(section.s + following.s_offset, section.end)
            if mark.type in PAINTED and end - start > 1e-3:
                yield from _mark_strips(road, section, lane, mark, start, end, cuts)


def _mark_strips(
    road: Road, section: LaneSection, lane: Lane, mark: RoadMark, start: float, end: float, cuts: Array
) -> Iterator[Strip]:
    kind = "marking_yellow" if mark.color == "yellow" else "marking_white"
    for offset, width, dash, gap, phase in _lines(lane, mark):
        period = dash + gap
        if dash > 0.0 and gap > 0.0 and period > FINEST and end - start < MOST_DASHES * period:
            starts = np.arange(start + (phase if phase >= 0.0 else phase % period), end, period)
            if not starts.size:
                continue
            bent = any(abs(road.reference.at(float(s)).curvature) > CURVED for s in (start, 0.5 * (start + end), end))
            share = np.linspace(0.0, 1.0, 4 if bent else 2)
            s = starts[:, None] + (np.minimum(starts + dash, end) - starts)[:, None] * share
        else:
            s = np.array([start, *(cut for cut in cuts if start < cut < end), end])[None, :]
        yield Strip(kind, s, _edge(road, section, lane, s) + offset, width)


def _lines(lane: Lane, mark: RoadMark) -> list[tuple[float, float, float, float, float]]:
    """Return the lines of a mark: offset from the lane edge in t, width, lengths of dash and gap, first s.

    A solid line has a gap of 0.
    """
    lines = [
        (line.t_offset, line.width, line.length, line.space, line.s_offset)
        for line in mark.lines
        if line.length > 0.0 or line.space > 0.0
    ]
    if lines:
        return lines
    words = mark.type.split()
    if mark.type == "botts dots":
        return [(0.0, 0.1, 0.1, 1.2, 0.0)]
    # Double lines are named from the inside out, those of lane 0 from left to right.
    outwards = lane.side if lane.id else -1
    offsets = [0.0] if len(words) == 1 else [-0.5 * APART * outwards, 0.5 * APART * outwards]
    pattern = {"solid": (0.0, 0.0), "broken": (DASH, GAP)}
    return [(offset, mark.width, *pattern[word], 0.0) for offset, word in zip(offsets, words, strict=True)]


def _edge(road: Road, section: LaneSection, lane: Lane, s: Array) -> Array:
    """Return t of the outer edge of a lane."""
    flat = [road.lane_offset.value(v) + lane.side * lane.outer.value(v - section.s) for v in s.ravel().tolist()]
    return np.array(flat).reshape(s.shape)


def object_strips(network: RoadNetwork) -> Iterator[tuple[str, Array]]:
    """Yield painted areas among the objects as convex polygons (M, 3). Crosswalks are split into stripes."""
    for item in network.objects:
        if item.type == "crosswalk":
            for outline in outlines(network, item):
                yield from _stripes(outline)
        elif item.type == "roadMark":
            for outline in outlines(network, item):
                yield "marking_white", outline


def _stripes(outline: Array) -> Iterator[tuple[str, Array]]:
    corners = outline[:-1] if len(outline) > 4 and np.allclose(outline[0], outline[-1]) else outline
    if len(corners) != 4:
        yield "marking_white", corners
        return
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    a, b, c, d = np.roll(corners, -int(np.argmax(sides)), axis=0)
    count = min(max(round(float(sides.max()) / (2.0 * STRIPE)), 1), MOST_STRIPES)
    for i in range(count):
        low, high = (i + 0.25) / count, (i + 0.75) / count
        yield "marking_white", np.array([a + low * (b - a), a + high * (b - a), d + high * (c - d), d + low * (c - d)])
