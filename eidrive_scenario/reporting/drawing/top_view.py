"""Top view of a street as SVG: ground truth as outlines, and the detections of one station.

SVG coordinates are x and -y of the world [m], so several figures of a page can share one drawing of the roads
(`roads_symbol` and `roads_id`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import footprint
from eidrive_scenario.reporting.snapshot import StationSnapshot

OWN, RECEIVED, LINK, LOST, AREA = "#2563eb", "#ea580c", "#0f9d58", "#dc2626", "#eab308"
FUSED, TRUTH, STATION = "#7c3aed", "#334155", "#0f172a"
PLAN, BRAKING = "#075985", "#831843"
LANES = {
    "sidewalk": "#e7e1d5",
    "median": "#dbe5d0",
    "shoulder": "#d8dce2",
    "border": "#d8dce2",
    "parking": "#cfd4dc",
    "bidirectional": "#c9ced7",
    "none": "#e4e9dd",
}
LANE, GROUND = "#c1c7d1", "#f1f3ee"
PAINT = {"yellow": "#f4c542"}
WHITE = "#ffffff"


@dataclass(frozen=True)
class Window:
    """Section of the world in a figure [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @classmethod
    def enclosing(cls, points: Iterable[Sequence[float]], margin: float = 6.0) -> Window:
        """Return the smallest window that contains all points (x, y, …) with a margin [m]."""
        plan = np.array([tuple(point[:2]) for point in points], dtype=np.float64)
        low, high = plan.min(axis=0) - margin, plan.max(axis=0) + margin
        return cls(float(low[0]), float(high[0]), float(low[1]), float(high[1]))

    @classmethod
    def centered(cls, center: tuple[float, float], width: float, ratio: float) -> Window:
        """Return the window of this width [m] around a center [m], with a ratio of width to height."""
        across, along = width / 2.0, width / ratio / 2.0
        return cls(center[0] - across, center[0] + across, center[1] - along, center[1] + along)

    def widened(self, ratio: float, least: float) -> Window:
        """Return the smallest window around this one with a ratio of width to height, at least `least` wide [m]."""
        width = max(self.right - self.left, ratio * (self.top - self.bottom), least)
        return Window.centered(((self.left + self.right) / 2.0, (self.bottom + self.top) / 2.0), width, ratio)

    @property
    def view_box(self) -> str:
        """Value of the SVG attribute viewBox."""
        return f"{self.left:.2f} {-self.top:.2f} {self.right - self.left:.2f} {self.top - self.bottom:.2f}"


@dataclass(frozen=True)
class RoadDrawing:
    """Roads from above: lanes (type, polygon (M, 2)), road marks (type, color, polyline (M, 2)), and the houses beside
    them (outline (M, 2), height) [m]."""

    lanes: tuple[tuple[str, Array], ...] = ()
    markings: tuple[tuple[str, str, Array], ...] = ()
    houses: tuple[tuple[Array, float], ...] = ()
    above: tuple[RoadDrawing, ...] = ()
    """Parts of roads that pass above others, from low to high: they are drawn after those below them."""

    @property
    def levels(self) -> tuple[RoadDrawing, ...]:
        """Return the drawings of lanes and road marks in the order in which they cover each other."""
        return (self, *self.above)


def roads_symbol(roads: RoadDrawing, identifier: str) -> str:
    """Return the roads as a group with an id, which several figures of a page can reference."""
    return f'<g id="{escape(identifier)}">{"".join(map(_level, roads.levels))}</g>'


def _level(roads: RoadDrawing) -> str:
    """Return lanes and road marks of one level."""
    lanes = "".join(
        f'<path d="{_path(polygon)}Z" fill="{LANES.get(kind, LANE)}" stroke="{LANES.get(kind, LANE)}" '
        'stroke-width="0.05"/>'
        for kind, polygon in roads.lanes
    )
    lines = "".join(
        f'<path d="{_path(line)}" fill="none" stroke="{PAINT.get(color, WHITE)}" stroke-width="0.18"{_dashes(kind)}/>'
        for kind, color, line in roads.markings
    )
    return lanes + lines


def top_view(
    snapshot: StationSnapshot,
    window: Window,
    *,
    roads: RoadDrawing | None = None,
    roads_id: str = "",
    conflict_areas: Sequence[Array] = (),
    labels: Mapping[str, str] | None = None,
    description: str = "",
) -> str:
    """Return the snapshot as an SVG element.

    roads           roads that are drawn into the figure
    roads_id        id of a `roads_symbol` of the same page, instead of `roads`
    conflict_areas  polygons (M, 2) [m]
    labels          label by actor name; the default is the name, "" omits the label
    description     title of the figure
    """
    view = snapshot.view
    names = labels or {}
    ground = f'<rect x="{window.left:.2f}" y="{-window.top:.2f}" width="100%" height="100%" fill="{GROUND}"/>'
    parts = [ground]
    if roads is not None:
        parts.append(roads_symbol(roads, ""))
    if roads_id:
        parts.append(f'<use href="#{escape(roads_id)}"/>')
    parts.extend(
        f'<path class="area" d="{_path(area)}Z" fill="{AREA}" fill-opacity="0.22" stroke="{AREA}" '
        'stroke-width="0.15" stroke-dasharray="0.7 0.4"/>'
        for area in conflict_areas
    )
    parts.extend(_links(snapshot))
    for received in snapshot.received:
        parts.extend(_boxes(received.message.detections, "received", RECEIVED, 0.55))
    parts.extend(_boxes(snapshot.own, "own", OWN, 0.25))
    parts.extend(_truth(snapshot))
    parts.extend(_labels(snapshot, window, {name: names.get(name, name) for name in view.names}))
    parts.append(_clock(window, snapshot.time))
    title = escape(description or f"top view at {snapshot.time:.2f} s with the detections of {snapshot.station}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="top-view" viewBox="{window.view_box}" role="img">'
        f"<title>{title}</title>{''.join(parts)}</svg>"
    )


def _truth(snapshot: StationSnapshot) -> list[str]:
    """Draw each actor as an outline with a bar at its front, the station itself filled, and a mast as a dot."""
    view, drawn = snapshot.view, []
    corners = footprint(view.boxes)
    for row, name in enumerate(view.names):
        length, width = view.size[row, :2]
        own = name == snapshot.station
        fill, opacity = (STATION, "1") if own else ("#ffffff", "0.35")
        if max(length, width) < 1.0:
            x, y = view.centers[row, :2]
            drawn.append(
                f'<circle class="truth" cx="{x:.2f}" cy="{-y:.2f}" r="0.7" fill="#ffffff" stroke="{TRUTH}" '
                f'stroke-width="0.25"/><circle cx="{x:.2f}" cy="{-y:.2f}" r="0.28" fill="{TRUTH}"/>'
            )
            continue
        drawn.append(
            f'<path class="truth" d="{_path(corners[row])}Z" fill="{fill}" fill-opacity="{opacity}" '
            f'stroke="{TRUTH}" stroke-width="0.14" stroke-linejoin="round"/>'
        )
        front = corners[row][[0, 3]]
        back = front + 0.22 * (corners[row][[1, 2]] - front)
        drawn.append(
            f'<path d="{_path(back)}" fill="none" stroke="{"#ffffff" if own else TRUTH}" stroke-width="0.22" '
            'stroke-linecap="round"/>'
        )
    return drawn


def _boxes(detections: Detections, kind: str, color: str, stroke: float) -> list[str]:
    """Draw boxes. Received boxes have a wider outline, so that boxes of two stations on one object are distinct."""
    return [
        f'<path class="{kind}" d="{_path(corners)}Z" fill="{color}" fill-opacity="0.28" stroke="{color}" '
        f'stroke-width="{stroke}" stroke-linejoin="round"/>'
        for corners in footprint(detections.boxes)
    ]


def _links(snapshot: StationSnapshot) -> list[str]:
    view = snapshot.view
    drawn: list[str] = []
    if snapshot.station not in view:
        return drawn
    x1, y1 = view.centers[view.row(snapshot.station), :2]
    for event in snapshot.links:
        if event.sender not in view:
            continue
        x0, y0 = view.centers[view.row(event.sender), :2]
        lost = event.outcome == "lost"
        color, dashes = (LOST, ' stroke-dasharray="0.9 0.9"') if lost else (LINK, "")
        drawn.append(
            f'<line class="link {event.outcome}" x1="{x0:.2f}" y1="{-y0:.2f}" x2="{x1:.2f}" y2="{-y1:.2f}" '
            f'stroke="{color}" stroke-width="0.22"{dashes}/>'
        )
    return drawn


def _labels(snapshot: StationSnapshot, window: Window, texts: Mapping[str, str]) -> list[str]:
    """Draw the label of each vehicle at the first free position: right, left, above or below."""
    view, size = snapshot.view, _text_size(window)
    bodies = [(*low, *high) for low, high in ((plan.min(0), plan.max(0)) for plan in footprint(view.boxes))]
    taken: list[tuple[float, ...]] = [tuple(map(float, body)) for body in bodies]
    drawn = []
    for row, name in enumerate(view.names):
        x, y = view.centers[row, :2].tolist()
        if not texts[name] or not (window.left <= x <= window.right and window.bottom <= y <= window.top):
            continue
        left, bottom, right, top = taken[row]
        half, width, gap = 0.5 * size, 0.58 * size * len(texts[name]), 0.45 * size
        positions = (
            ("start", right + gap, y, right + gap),
            ("end", left - gap, y, left - gap - width),
            ("middle", x, top + gap + half, x - width / 2),
            ("middle", x, bottom - gap - half, x - width / 2),
        )
        rectangles = [(start, middle - half, start + width, middle + half) for _, _, middle, start in positions]
        free = [
            index
            for index, rectangle in enumerate(rectangles)
            if window.left <= rectangle[0] and rectangle[2] <= window.right
            if not any(_overlap(rectangle, other) for other in taken)
        ]
        best = free[0] if free else 0
        taken.append(rectangles[best])
        anchor, at, middle, _ = positions[best]
        drawn.append(
            f'<text x="{at:.2f}" y="{-middle + 0.35 * size:.2f}" font-size="{size:.2f}" text-anchor="{anchor}" '
            f'fill="{STATION}" stroke="#ffffff" stroke-width="{0.22 * size:.2f}" paint-order="stroke" '
            f'stroke-linejoin="round">{escape(texts[name])}</text>'
        )
    return drawn


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """True if two rectangles (left, bottom, right, top) overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _clock(window: Window, time: float) -> str:
    size = 1.15 * _text_size(window)
    return (
        f'<text x="{window.left + 0.6 * size:.2f}" y="{-window.top + 1.4 * size:.2f}" font-size="{size:.2f}" '
        f'font-weight="600" fill="{STATION}" stroke="#ffffff" stroke-width="{0.2 * size:.2f}" paint-order="stroke">'
        f"t = {time:.2f} s</text>"
    )


def _text_size(window: Window) -> float:
    return (window.right - window.left) / 24


def is_broken(kind: str) -> bool:
    """True if a road mark of this type is broken; for a double line, if both lines are."""
    return set(kind.split()) == {"broken"}


def _dashes(kind: str) -> str:
    return ' stroke-dasharray="3 3"' if is_broken(kind) else ""


def _path(points: Array) -> str:
    return "M" + "L".join(f"{x:.2f} {-y:.2f}" for x, y in np.asarray(points)[:, :2].tolist())


def legend() -> str:
    """Return the legend of colors and lines of a top view as HTML."""
    box = '<svg viewBox="0 0 26 14"><rect x="2" y="2" width="22" height="10" rx="1" {}/></svg>'
    line = '<svg viewBox="0 0 26 14"><line x1="1" x2="25" y1="7" y2="7" stroke-width="2" {}/></svg>'
    sample = 'fill="{0}" fill-opacity=".3" stroke="{0}" stroke-width="2"'
    entries = (
        (box.format(f'fill="#fff" stroke="{TRUTH}" stroke-width="1.4"'), "ground truth"),
        (box.format(f'fill="{STATION}"'), "ego"),
        (box.format(sample.format(OWN)), "detected by the ego"),
        (box.format(sample.format(RECEIVED)), "received from others"),
        (line.format(f'stroke="{LINK}"'), "message delivered"),
        (line.format(f'stroke="{LOST}" stroke-dasharray="5 4"'), "message lost"),
        (
            box.format(f'fill="{AREA}" fill-opacity=".25" stroke="{AREA}" stroke-dasharray="4 2"'),
            "conflict area: the ego stops while a detected car is inside",
        ),
    )
    return "".join(f"<span>{symbol}{escape(text)}</span>" for symbol, text in entries)
