"""Top view of one instant as an image: ground truth, and the information of one station."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import footprint
from eidrive_scenario.reporting.drawing.canvas import Canvas, Image
from eidrive_scenario.reporting.drawing.ellipse import ellipse_of_95_percent
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
    view = snapshot.view
    for name, box, speed in zip(view.names, view.boxes, view.speed.tolist(), strict=True):
        if not np.isfinite(box).all():
            continue
        left, base = canvas.pixel(footprint(box).max(axis=0))
        moving = f"  {3.6 * speed:.0f} km/h" if abs(speed) > 0.05 else ""
        canvas.label(name + moving, left + 6, base + 4)
    plan = snapshot.step.plan if snapshot.step else None
    canvas.label(f"t = {snapshot.time:.2f} s", 16, 32, 0.8, STATION)
    if plan is not None:
        canvas.label(f"{snapshot.station}: {plan.reason}", 16, 60, 0.6, STATION)
