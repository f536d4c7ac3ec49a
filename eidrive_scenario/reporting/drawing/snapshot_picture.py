"""Top view of one instant: ground truth, and the information of one station, as an image or on any canvas."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import footprint
from eidrive_scenario.reporting.drawing.canvas import Canvas, ellipse_of_95_percent
from eidrive_scenario.reporting.drawing.image_canvas import Image, ImageCanvas
from eidrive_scenario.reporting.drawing.labels import Rectangle, wrapped, write_labels
from eidrive_scenario.reporting.drawing.top_view import (
    AREA,
    BRAKING,
    FUSED,
    LINK,
    LOST,
    OWN,
    PLAN,
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


def snapshot_picture(
    snapshot: StationSnapshot,
    roads: RoadDrawing,
    center: tuple[float, float],
    *,
    size: tuple[int, int] = (1280, 720),
    extent: float = EXTENT,
) -> Image:
    """Return the picture (height, width, 3) in the channel order of OpenCV.

    center  of the section [m]
    size    width and height [pixels]
    extent  width of the section [m]
    """
    canvas = ImageCanvas(Window.centered(center, extent, size[0] / size[1]), size)
    draw_snapshot(canvas, snapshot, roads)
    return canvas.image


def draw_snapshot(
    canvas: Canvas, snapshot: StationSnapshot, roads: RoadDrawing, conflict_areas: Sequence[Array] = ()
) -> None:
    """Draw a snapshot on its roads and on conflict areas, polygons (M, 2) [m].

    Boxes are blue if the station detects them itself, orange if it received them, violet after fusion. The planned path
    and delivered messages are green; a path with demanded braking and lost messages are red.
    """
    canvas.roads(roads)
    for area in conflict_areas:
        canvas.fill(area, AREA, 0.2, legend="conflict area")
    _draw_plan(canvas, snapshot)
    _draw_links(canvas, snapshot)
    for received in snapshot.received:
        _draw_boxes(canvas, received.message.detections, RECEIVED, 0.5, "received from others")
    _draw_boxes(canvas, snapshot.own, OWN, 0.25, f"detected by {snapshot.station}")
    _draw_boxes(canvas, snapshot.fused, FUSED, 0.0, "after fusion")
    view = snapshot.view
    for name, box in zip(view.names, view.boxes.tolist(), strict=True):
        if math.isfinite(sum(box)) and canvas.window.reaches(footprint(np.array(box))):
            is_station = name == snapshot.station
            color, opacity = (STATION, 1.0) if is_station else (WHITE, 0.35)
            canvas.body(box, color, opacity, legend=name if is_station else "other actors")
    _write_labels(canvas, snapshot)


def _draw_plan(canvas: Canvas, snapshot: StationSnapshot) -> None:
    plan = snapshot.step.plan if snapshot.step else None
    if plan is not None and len(plan.points) > 1 and np.isfinite(plan.points).all():
        color, legend = (PLAN, "planned path") if plan.braking is None else (BRAKING, "planned path, braking")
        canvas.line(plan.points, color, 0.4, legend=legend)


def _draw_links(canvas: Canvas, snapshot: StationSnapshot) -> None:
    view = snapshot.view
    for event in snapshot.links:
        if event.sender in view and snapshot.station in view:
            ends = [view.centers[view.row(name), :2].tolist() for name in (event.sender, snapshot.station)]
            if not np.isfinite(ends).all():
                continue
            if event.outcome == "lost":
                canvas.line(ends, LOST, 0.2, stroke=STROKE, legend="message lost")
            else:
                canvas.line(ends, LINK, 0.2, legend="message delivered")


def _draw_boxes(canvas: Canvas, detections: Detections, color: str, width: float, legend: str) -> None:
    for box, covariance in zip(detections.boxes, detections.covariance, strict=True):
        if not np.isfinite(box).all():
            continue
        corners = footprint(box)
        canvas.fill(corners, color, 0.2, legend=legend)
        canvas.line(corners, color, width, closed=True)
        axes = ellipse_of_95_percent(covariance) if color == FUSED else None
        if axes is not None:
            canvas.ellipse(box, axes[:2], axes[2], color, legend="95 % of the position")


def _write_labels(canvas: Canvas, snapshot: StationSnapshot) -> None:
    """Write the title, and labels beside the actors: of the station, of senders, and of others from near to far."""
    plan = snapshot.step.plan if snapshot.step else None
    margin = 1.5 * canvas.label_size("t")[1]
    lines = [(f"t = {snapshot.time:.2f} s", 1.6)]
    if plan is not None:
        reason = wrapped(canvas, f"{snapshot.station}: {plan.reason}", canvas.size[0] - 2.0 * margin, 1.2)
        lines += [(line, 1.2) for line in reason]
    base, titles = margin, list[Rectangle]()
    for text, size in lines:
        width, height = canvas.label_size(text, size)
        base += height
        canvas.label(text, margin, base, size, STATION)
        titles.append((margin, base - height, margin + width, base))
        base += 0.7 * height
    view = snapshot.view
    senders = {event.sender for event in snapshot.links}
    middle = np.array([canvas.window.left + canvas.window.right, canvas.window.bottom + canvas.window.top]) / 2.0
    away = np.hypot(*(view.boxes[:, :2] - middle).T)
    order = sorted(
        np.flatnonzero(np.isfinite(view.boxes).all(axis=1)).tolist(),
        key=lambda row: (view.names[row] != snapshot.station, view.names[row] not in senders, away[row]),
    )
    texts = []
    for row in order:
        speed = snapshot.speeds[view.names[row]]
        texts.append(f"{view.names[row]}  {speed:.1f} m/s" if abs(speed) > 0.05 else view.names[row])
    write_labels(canvas, texts, [footprint(view.boxes[row]) for row in order], titles)
