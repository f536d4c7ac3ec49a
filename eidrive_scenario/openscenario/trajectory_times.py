"""Times of trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from eidrive_scenario.openscenario.model import Clothoid, ClothoidSpline, Element, Nurbs, Polyline

TIME_ATTRIBUTES: Mapping[type[Element], str] = {
    Polyline: "the time of each vertex",
    Clothoid: "startTime and stopTime",
    ClothoidSpline: "timeEnd",
    Nurbs: "the time of each control point",
}
"""Attributes of a shape that specify its times."""


def has_times(shape: Element) -> bool:
    """Return True if a shape has all times that a Timing scales, and they are not all equal."""
    if isinstance(shape, Polyline):
        return _ascend([vertex.time for vertex in shape.vertex])
    if isinstance(shape, Nurbs):
        return _ascend([point.time for point in shape.control_point])
    if isinstance(shape, Clothoid):
        return _ascend([shape.start_time, shape.stop_time])
    if isinstance(shape, ClothoidSpline):
        first = shape.clothoid_spline_segment[0].time_start if shape.clothoid_spline_segment else None
        return _ascend([first or 0.0, shape.time_end])
    return False


def _ascend(times: Sequence[float | None]) -> bool:
    known = [time for time in times if time is not None]
    return len(known) == len(times) and len(known) > 1 and known[-1] > known[0]
