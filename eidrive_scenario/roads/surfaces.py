"""Road surfaces for drawing: triangles of lanes, curbs and markings as arrays.

Road marks are painted strips along lane edges, and painted areas.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road, RoadMark
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.objects import outlines, placed_objects

KINDS = {
    "driving": (0.22, 0.22, 0.24),
    "junction": (0.22, 0.22, 0.24),
    "shoulder": (0.30, 0.30, 0.31),
    "parking": (0.27, 0.27, 0.29),
    "sidewalk": (0.55, 0.54, 0.52),
    "curb": (0.68, 0.67, 0.65),
    "median": (0.33, 0.42, 0.24),
    "verge": (0.33, 0.42, 0.24),
    "biking": (0.42, 0.24, 0.20),
    "marking_white": (0.92, 0.92, 0.90),
    "marking_yellow": (0.92, 0.75, 0.16),
}
"""Kinds of surface with their colors: red, green, blue in [0, 1]."""

_BY_LANE_TYPE = {
    "sidewalk": "sidewalk",
    "walking": "sidewalk",
    "shoulder": "shoulder",
    "stop": "shoulder",
    "border": "curb",
    "curb": "curb",
    "parking": "parking",
    "median": "median",
    "restricted": "median",
    "biking": "biking",
    "none": "verge",
}
FLATNESS = 0.01
"""Maximum deviation of a cross section from the straight surface that replaces it [m]."""
LONGEST = 25.0
"""Maximum distance between two cross sections [m]."""
FILL_RADIUS = 9.0
"""Maximum circumradius of triangles that fill junctions [m]. It covers the holes between lanes, not the corner bays."""
FILL_DEPTH = 0.02
CYCLE_DEPTH = 0.01
MARKING_HEIGHT = 0.02
"""Vertical offset of markings above the surface [m].

The filling of junctions is below the surface, and cycle lanes across a junction are between the two. The offsets
prevent flickering in images.
"""


@dataclass(frozen=True)
class SurfaceMesh:
    """Triangles of one kind: vertices (V, 3) in the world [m], faces (F, 3) counter-clockwise from above.

    kind  one of KINDS
    """

    kind: str
    vertices: Array
    faces: Integers

    @property
    def color(self) -> tuple[float, float, float]:
        """Red, green, blue in [0, 1]."""
        return KINDS[self.kind]


def surface_meshes(network: RoadNetwork, spacing: float = 2.0) -> list[SurfaceMesh]:
    """Return all road surfaces and markings as one mesh per kind.

    `spacing` is the distance between the evaluated cross sections [m]. Cross sections within a centimeter of a straight
    surface are omitted.
    """
    parts: list[SurfaceMesh] = []
    edges: dict[str, list[Array]] = {}
    for road in network.roads.values():
        for section in road.sections:
            s = cross_sections(network, road, section, spacing)
            parts.extend(_lane_parts(network, road, section, s, edges))
            parts.extend(_lane_markings(network, road, section, s))
    parts.extend(_fillings(edges))
    for polygon in painted_areas(network):
        lifted = np.add(polygon, (0.0, 0.0, MARKING_HEIGHT))
        faces = np.array([(0, i, i + 1) for i in range(1, len(polygon) - 1)], dtype=np.int64)
        parts.append(SurfaceMesh("marking_white", lifted, _upwards(lifted, faces)))
    by_kind = {kind: [part for part in parts if part.kind == kind] for kind in KINDS}
    return [_merged(kind, group) for kind, group in by_kind.items() if group]


def cross_sections(network: RoadNetwork, road: Road, section: LaneSection, spacing: float) -> Array:
    """Return the s of the cross sections of a lane section for drawing: both ends and as many as its curves need."""
    count = max(int(np.ceil(section.length / spacing)), 1) + 1
    s = section.s + np.linspace(0.0, max(section.length - 1e-9, 0.0), count)
    left, right = (
        max((lane.outer.value(0.0) for lane in section.lanes.values() if lane.side == k), default=0.0) for k in (1, -1)
    )
    outline = [network.road_pose(road.id, s, t) for t in (left + 1.0, -right - 1.0)]
    widths = [[lane.width.value(float(at) - section.s) for at in s] for lane in section.lanes.values()]
    offset = [road.lane_offset.value(float(at)) for at in s]
    shape = np.column_stack([*(axis for pose in outline for axis in pose[:3]), *widths, offset])
    return np.asarray(s[_needed_rows(shape, s)])


def _needed_rows(shape: Array, s: Array) -> Bools:
    """Return which rows a polyline through `shape` needs (Douglas and Peucker 1973)."""
    kept = np.zeros(len(s), dtype=bool)
    kept[[0, -1]] = True
    waiting = [(0, len(s) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        part = ((s[first + 1 : last] - s[first]) / (s[last] - s[first]))[:, None]
        gap = np.abs(shape[first + 1 : last] - shape[first] - part * (shape[last] - shape[first])).max(axis=1)
        worst = first + 1 + int(np.argmax(gap))
        if gap.max() <= FLATNESS:
            if s[last] - s[first] <= LONGEST:
                continue
            worst = (first + last) // 2
        kept[worst] = True
        waiting += [(first, worst), (worst, last)]
    return kept


def _lane_parts(
    network: RoadNetwork, road: Road, section: LaneSection, s: Array, edges: dict[str, list[Array]]
) -> Iterable[SurfaceMesh]:
    offset = np.array([road.lane_offset.value(float(at)) for at in s])
    for lane in section.lanes.values():
        ds = [float(at) - section.s for at in s]
        width = np.array([lane.width.value(d) for d in ds])
        if lane.id == 0 or width.max() < 1e-3:
            continue
        kind = _kind(road, lane)
        if kind is None:
            continue
        inner = offset + lane.side * np.array([lane.inner.value(d) for d in ds])
        outer = offset + lane.side * np.array([lane.outer.value(d) for d in ds])
        low, high = _points(network, road, s, inner), _points(network, road, s, outer)
        if kind == "junction" and road.junction_id is not None:
            edges.setdefault(road.junction_id, []).extend((low, high))
        if kind == "biking" and road.junction_id is not None:
            low, high = low - (0.0, 0.0, CYCLE_DEPTH), high - (0.0, 0.0, CYCLE_DEPTH)
        lift_inner, lift_outer = _lift(lane, ds)
        raised = low + np.outer(lift_inner, (0.0, 0.0, 1.0))
        vertices = np.concatenate([raised, high + np.outer(lift_outer, (0.0, 0.0, 1.0))])
        faces = _ribbons(1, len(s))
        yield SurfaceMesh(kind, vertices, _upwards(vertices, faces))
        if np.any(lift_inner > 1e-3):
            yield SurfaceMesh("curb", np.concatenate([low, raised]), faces if lane.side > 0 else faces[:, ::-1])


def _kind(road: Road, lane: Lane) -> str | None:
    if lane.drivable:
        return "driving" if road.junction_id is None else "junction"
    if road.junction_id is not None and lane.type == "none":
        return None
    return _BY_LANE_TYPE.get(lane.type, "verge")


def _lift(lane: Lane, ds: list[float]) -> tuple[Array, Array]:
    inner, outer = np.zeros(len(ds)), np.zeros(len(ds))
    for height in lane.heights:
        after = np.array(ds) >= height.s_offset - 1e-9
        inner[after], outer[after] = height.inner, height.outer
    return inner, outer


def _points(network: RoadNetwork, road: Road, s: Array, t: Array) -> Array:
    pose = network.road_pose(road.id, s, t)
    return np.column_stack([pose.x, pose.y, pose.z])


def _ribbons(pieces: int, count: int) -> Integers:
    """Return triangles between the low and the high edges of some pieces with `count` points on each edge.

    The points of all high edges are numbered after those of all low edges.
    """
    i = (np.arange(pieces)[:, None] * count + np.arange(count - 1)).ravel()
    above = i + pieces * count
    return np.concatenate([np.column_stack([i, i + 1, above]), np.column_stack([i + 1, above + 1, above])])


def _fillings(edges: dict[str, list[Array]]) -> Iterable[SurfaceMesh]:
    """Yield the surface of junctions between and below their connecting lanes."""
    for lines in edges.values():
        from scipy.spatial import Delaunay, QhullError

        points = np.concatenate(lines)
        try:
            faces: Integers = Delaunay(points[:, :2]).simplices.astype(np.int64)
        except QhullError:
            continue
        a, b, c = (points[faces[:, k], :2] for k in range(3))
        sides = [np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (c, a))]
        double_area = np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1]))
        radius = sides[0] * sides[1] * sides[2] / np.maximum(2.0 * double_area, 1e-9)
        faces = faces[radius <= FILL_RADIUS]
        if faces.size:
            yield SurfaceMesh("junction", points - (0.0, 0.0, FILL_DEPTH), _upwards(points, faces))


def _upwards(vertices: Array, faces: Integers) -> Integers:
    """Return the faces in counter-clockwise order seen from above."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    up = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    return np.where((up < 0.0)[:, None], faces[:, ::-1], faces)


def _merged(kind: str, parts: Sequence[SurfaceMesh]) -> SurfaceMesh:
    first = accumulate((len(part.vertices) for part in parts), initial=0)
    faces = [part.faces + start for part, start in zip(parts, first, strict=False)]
    return SurfaceMesh(kind, np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


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


def _lane_markings(network: RoadNetwork, road: Road, section: LaneSection, cuts: Array) -> Iterator[SurfaceMesh]:
    """Yield the marks of a lane section. Solid lines may bend at the values of s in `cuts`."""
    for lane in section.lanes.values():
        if road.junction_id is not None and lane.type == "none" and lane.id:
            continue
        marks = lane.road_marks
        for mark, following in zip(marks, (*marks[1:], None), strict=False):
            start = section.s + max(mark.s_offset, 0.0)
            end = section.end if following is None else min(section.s + following.s_offset, section.end)
            is_painted = mark.type in PAINTED or (mark.type == "custom" and mark.lines)
            if is_painted and end - start > 1e-3:
                kind = "marking_yellow" if mark.color == "yellow" else "marking_white"
                for s, t, width in _mark_strips(road, section, lane, mark, start, end, cuts):
                    low, high = (_points(network, road, s.ravel(), (t + k * width).ravel()) for k in (-0.5, 0.5))
                    vertices = np.concatenate([low, high])
                    vertices[:, 2] += MARKING_HEIGHT
                    yield SurfaceMesh(kind, vertices, _ribbons(*s.shape))


def _mark_strips(
    road: Road, section: LaneSection, lane: Lane, mark: RoadMark, start: float, end: float, cuts: Array
) -> Iterator[tuple[Array, Array, float]]:
    """Yield paint along a road: s and t (K, P) of K pieces with P points each, and width [m]."""
    for offset, width, dash, gap, phase in _lines(lane, mark):
        dashes = _dashes(start, end, dash, gap, phase)
        if not dashes.size:
            continue
        if _is_broken(end - start, dash, gap):
            bent = any(abs(road.reference.at(float(s)).curvature) > CURVED for s in (start, 0.5 * (start + end), end))
            share = np.linspace(0.0, 1.0, 4 if bent else 2)
            s = dashes[:, :1] + np.diff(dashes) * share
        else:
            ((low, high),) = dashes.tolist()
            s = np.array([low, *(cut for cut in cuts if low < cut < high), high])[None, :]
        yield s, _edge(road, section, lane, s) + offset, width


def mark_dashes(lane: Lane, mark: RoadMark, start: float, end: float) -> Array:
    """Return s of the starts and ends of the dashes (K, 2) of the first line of a mark [m]. A solid line has one."""
    lines = _lines(lane, mark)
    return _dashes(start, end, *lines[0][2:]) if lines else np.empty((0, 2))


def _dashes(start: float, end: float, dash: float, gap: float, phase: float) -> Array:
    period = dash + gap
    if _is_broken(end - start, dash, gap):
        starts = np.arange(start + (phase if phase >= 0.0 else phase % period), end, period)
        return np.column_stack([starts, np.minimum(starts + dash, end)])
    low, high = (start + phase, min(start + phase + dash, end)) if math.isinf(gap) else (start, end)
    return np.array([[low, high]] if low < high else []).reshape(-1, 2)


def _is_broken(length: float, dash: float, gap: float) -> bool:
    """Return whether a line of this length has dashes that are neither too short nor too many."""
    period = dash + gap
    return dash > 0.0 and 0.0 < gap < math.inf and period > FINEST and length < MOST_DASHES * period


def _lines(lane: Lane, mark: RoadMark) -> list[tuple[float, float, float, float, float]]:
    """Return the lines of a mark: offset from the lane edge in t, width, lengths of dash and gap, first s.

    A solid line has a gap of 0.
    """
    if any(line.length > 0.0 or line.space > 0.0 for line in mark.lines):
        return [
            (line.t_offset, line.width, line.length, line.space, line.s_offset)
            for line in mark.lines
            if line.length > 0.0 or line.space == 0.0
        ]
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


def painted_areas(network: RoadNetwork) -> Iterator[Array]:
    """Yield painted areas among the objects as convex polygons (M, 3). Crosswalks are split into stripes."""
    for placed in placed_objects(network):
        if placed.object.type in ("crosswalk", "roadMark"):
            for outline in outlines(network, placed):
                yield from _stripes(outline) if placed.object.type == "crosswalk" else (outline,)


def _stripes(outline: Array) -> Iterator[Array]:
    corners = outline[:-1] if len(outline) > 4 and np.allclose(outline[0], outline[-1]) else outline
    if len(corners) != 4:
        yield corners
        return
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    a, b, c, d = np.roll(corners, -int(np.argmax(sides)), axis=0)
    count = min(max(round(float(sides.max()) / (2.0 * STRIPE)), 1), MOST_STRIPES)
    for i in range(count):
        low, high = (i + 0.25) / count, (i + 0.75) / count
        yield np.array([a + low * (b - a), a + high * (b - a), d + high * (c - d), d + low * (c - d)])
