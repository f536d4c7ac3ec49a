"""Top view of one instant as an image: ground truth, and the information of one station."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import footprint
from eidrive_scenario.reporting.drawing.canvas import Canvas, Image, ellipse_of_95_percent
from eidrive_scenario.reporting.drawing.top_view import (
    FUSED,
    LINK,
    LOST,
    OWN,
    RECEIVED,
    STATION,
    WHITE,
    RoadDrawing,
    Window,
)
from eidrive_scenario.reporting.snapshot import StationSnapshot

EXTENT = 90.0
"""Default width of the section that is shown [m]."""
STROKE = 1.0
"""Length of the strokes of the line of a lost message [m]."""
GAP = 6
"""Distance of a label from its actor [pixels]."""
MOST_PLACED = 100
"""Maximum number of actors in a picture whose labels avoid each other."""
Rectangle: TypeAlias = tuple[int, int, int, int]
"""Left, top, right and bottom [pixels]."""


def snapshot_picture(
    snapshot: StationSnapshot,
    roads: RoadDrawing,
    center: tuple[float, float],
    *,
    size: tuple[int, int] = (1280, 720),
    extent: float = EXTENT,
) -> Image:
    """Return the picture (height, width, 3) in the channel order of OpenCV.

    Boxes are blue if the station detects them itself, orange if it received them, violet after fusion. The planned path
    and delivered messages are green; a path with demanded braking and lost messages are red.

    center  of the section [m]
    size    width and height [pixels]
    extent  width of the section [m]
    """
    half, high = extent / 2.0, extent * size[1] / size[0] / 2.0
    canvas = Canvas(Window(center[0] - half, center[0] + half, center[1] - high, center[1] + high), size)
    canvas.roads(roads)
    _draw_plan(canvas, snapshot)
    _draw_links(canvas, snapshot)
    for received in snapshot.received:
        _draw_boxes(canvas, received.message.detections, RECEIVED, 0.5)
    _draw_boxes(canvas, snapshot.own, OWN, 0.25)
    _draw_boxes(canvas, snapshot.fused, FUSED, 0.0)
    view = snapshot.view
    for name, box in zip(view.names, view.boxes.tolist(), strict=True):
        if math.isfinite(sum(box)):
            canvas.body(box, STATION if name == snapshot.station else WHITE, 1.0 if name == snapshot.station else 0.35)
    _write_labels(canvas, snapshot)
    return canvas.image


def _draw_plan(canvas: Canvas, snapshot: StationSnapshot) -> None:
    plan = snapshot.step.plan if snapshot.step else None
    if plan is not None and len(plan.points) > 1 and np.isfinite(plan.points).all():
        canvas.line(plan.points, LINK if plan.braking is None else LOST, 0.4)


def _draw_links(canvas: Canvas, snapshot: StationSnapshot) -> None:
    view = snapshot.view
    for event in snapshot.links:
        if event.sender in view and snapshot.station in view:
            ends = [view.centers[view.row(name), :2].tolist() for name in (event.sender, snapshot.station)]
            if not np.isfinite(ends).all():
                continue
            if event.outcome == "lost":
                canvas.dashes(ends[0], ends[1], LOST, 0.2, STROKE)
            else:
                canvas.line(ends, LINK, 0.2)


def _draw_boxes(canvas: Canvas, detections: Detections, color: str, width: float) -> None:
    for box, covariance in zip(detections.boxes, detections.covariance, strict=True):
        if not np.isfinite(box).all():
            continue
        corners = footprint(box)
        canvas.fill(corners, color, 0.2)
        canvas.line(corners, color, width, closed=True)
        axes = ellipse_of_95_percent(covariance) if color == FUSED else None
        if axes is not None:
            canvas.ellipse(box, axes[:2], axes[2], color)


def _write_labels(canvas: Canvas, snapshot: StationSnapshot) -> None:
    """Write the title, and a label beside each actor where it covers least of other actors and labels."""
    plan = snapshot.step.plan if snapshot.step else None
    lines = [(f"t = {snapshot.time:.2f} s", 32, 0.8)]
    if plan is not None:
        lines.append((f"{snapshot.station}: {plan.reason}", 60, 0.6))
    labels = []
    for text, base, size in lines:
        width, height = canvas.label_size(text, size)
        labels.append((16, base - height, 16 + width, base))
        canvas.label(text, 16, base, size, STATION)
    view = snapshot.view
    outlines: dict[str, Rectangle] = {}
    for name, box in zip(view.names, view.boxes, strict=True):
        if np.isfinite(box).all():
            corners = footprint(box)
            left, bottom = canvas.pixel(corners.min(axis=0))
            right, top = canvas.pixel(corners.max(axis=0))
            if _overlap((left, top, right + 1, bottom + 1), (0, 0, *canvas.image.shape[1::-1])):
                outlines[name] = left, top, right, bottom
    for name, outline in outlines.items():
        speed = float(view.speed[view.row(name)])
        text = f"{name}  {3.6 * speed:.0f} km/h" if abs(speed) > 0.05 else name
        others = [*(other for named, other in outlines.items() if named != name), *labels]
        place = _place(canvas.label_size(text), outline, others if len(outlines) <= MOST_PLACED else [])
        labels.append(place)
        canvas.label(text, place[0], place[3])


def _place(size: tuple[int, int], outline: Rectangle, others: list[Rectangle]) -> Rectangle:
    """Return the place of a label of this size right, left, above or below an outline with the least overlap."""
    (width, height), (left, top, right, bottom) = size, outline
    middle, base = (left + right - width) // 2, (top + bottom + height) // 2
    starts = [(right + GAP, base), (left - GAP - width, base), (middle, top - GAP), (middle, bottom + GAP + height)]
    places = [(x, y - height, x + width, y) for x, y in starts]
    return min(places, key=lambda place: sum(_overlap(place, other) for other in others))


def _overlap(first: Rectangle, second: Rectangle) -> int:
    """Return the common area of two rectangles."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    return max(width, 0) * max(height, 0)
