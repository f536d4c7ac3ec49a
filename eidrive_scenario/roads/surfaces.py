"""Road surfaces for drawing: triangles of lanes, curbs and markings as arrays.

Road marks are painted strips along lane edges, and painted areas.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road, RoadMark
from eidrive_scenario.roads.network import RoadNetwork
from eidrive_scenario.roads.objects import outlines

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


@dataclass(frozen=True)
class _Part:
    kind: str
    vertices: Array
    faces: Integers


def surface_meshes(network: RoadNetwork, spacing: float = 2.0) -> list[SurfaceMesh]:
    """Return all road surfaces and markings as one mesh per kind.

    `spacing` is the distance between the evaluated cross sections [m]. Cross sections within a centimeter of a straight
    surface are omitted.
    """
    parts: list[_Part] = []
    edges: dict[str, list[Array]] = {}
    for road in network.roads.values():
        for section in road.sections:
            s = cross_sections(network, road, section, spacing)
            parts.extend(_lane_parts(network, road, section, s, edges))
            parts.extend(_strip_part(network, road, strip) for strip in lane_strips(road, section, s))
    parts.extend(_fillings(edges))
    for kind, polygon in object_strips(network):
        lifted = np.add(polygon, (0.0, 0.0, MARKING_HEIGHT))
        faces = np.array([(0, i, i + 1) for i in range(1, len(polygon) - 1)], dtype=np.int64)
        parts.append(_Part(kind, lifted, _upwards(lifted, faces)))
    return [
        mesh for kind in KINDS if (mesh := _merged(kind, (part for part in parts if part.kind == kind))) is not None
    ]


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
    kept = np.zeros(count, dtype=bool)
    kept[[0, -1]] = True
    _keep(shape, s, kept, 0, count - 1)
    sections: Array = s[kept]
    return sections


def _keep(shape: Array, s: Array, kept: NDArray[np.bool_], first: int, last: int) -> None:
    """Mark the rows that a polyline through `shape` needs (Douglas and Peucker 1973)."""
    waiting = [(first, last)]
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


def _lane_parts(
    network: RoadNetwork, road: Road, section: LaneSection, s: Array, edges: dict[str, list[Array]]
) -> Iterable[_Part]:
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
        faces = _ribbon(len(s))
        yield _part(kind, raised, high + np.outer(lift_outer, (0.0, 0.0, 1.0)), faces)
        if np.any(lift_inner > 1e-3):
            yield _part("curb", low, raised, faces, keep_order=lane.side > 0)


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


def _ribbon(count: int) -> Integers:
    """Return triangles between two rows of `count` points. The second row is numbered after the first."""
    i = np.arange(count - 1)
    return np.concatenate([np.column_stack([i, i + 1, i + count]), np.column_stack([i + 1, i + count + 1, i + count])])


def _part(kind: str, first: Array, second: Array, faces: Integers, keep_order: bool | None = None) -> _Part:
    vertices = np.concatenate([first, second])
    if keep_order is None:
        return _Part(kind, vertices, _upwards(vertices, faces))
    return _Part(kind, vertices, faces if keep_order else faces[:, ::-1])


def _strip_part(network: RoadNetwork, road: Road, strip: Strip) -> _Part:
    count = strip.s.shape[1]
    flat = strip.s.ravel()
    low = _points(network, road, flat, (strip.t - 0.5 * strip.width).ravel())
    high = _points(network, road, flat, (strip.t + 0.5 * strip.width).ravel())
    vertices = np.concatenate([low, high])
    vertices[:, 2] += MARKING_HEIGHT
    i = (np.arange(strip.s.shape[0])[:, None] * count + np.arange(count - 1)).ravel()
    above = i + flat.size
    faces = np.concatenate([np.column_stack([i, i + 1, above]), np.column_stack([i + 1, above + 1, above])])
    return _Part(strip.kind, vertices, faces)


def _fillings(edges: dict[str, list[Array]]) -> Iterable[_Part]:
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
            yield _Part("junction", points - (0.0, 0.0, FILL_DEPTH), _upwards(points, faces))


def _upwards(vertices: Array, faces: Integers) -> Integers:
    """Return the faces in counter-clockwise order seen from above."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    up = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    return np.where((up < 0.0)[:, None], faces[:, ::-1], faces)


def _merged(kind: str, parts: Iterable[_Part]) -> SurfaceMesh | None:
    vertices, faces, count = [], [], 0
    for part in parts:
        vertices.append(part.vertices)
        faces.append(part.faces + count)
        count += len(part.vertices)
    if not vertices:
        return None
    return SurfaceMesh(kind, np.concatenate(vertices), np.concatenate(faces))


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


@dataclass(frozen=True)
class Strip:
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
    for road_object in network.objects:
        if road_object.type == "crosswalk":
            for outline in outlines(network, road_object):
                yield from _stripes(outline)
        elif road_object.type == "roadMark":
            for outline in outlines(network, road_object):
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
