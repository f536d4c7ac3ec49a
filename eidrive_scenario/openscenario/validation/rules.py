"""Rules that the schema cannot express: duplicate names, dangling references, contradictory values.

The rules apply to incompletely read scenarios too: a field may be missing if the reader has reported an error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import (
    AbsoluteTargetLane,
    CatalogReference,
    Clothoid,
    ClothoidSpline,
    Condition,
    DynamicsDimension,
    Element,
    LaneLayerType,
    LanePosition,
    LongitudinalDistanceAction,
    Nurbs,
    OpenScenario,
    Orientation,
    Polyline,
    PreferredLaneLayerAction,
    RelativeLanePosition,
    RelativeTargetLane,
    Timing,
    TransitionDynamics,
)
from eidrive_scenario.openscenario.validation.declared_types import check_types
from eidrive_scenario.openscenario.validation.names import check_names
from eidrive_scenario.openscenario.validation.numbers import unusable
from eidrive_scenario.openscenario.values.scalars import Version

MAX_NURBS_ORDER = 20
"""Maximum order of a Nurbs. The time per sample grows with its square; roads and maneuvers have orders up to 6."""
_EMPTY_ORIENTATION = Orientation()


def check_rules(
    root: OpenScenario, version: Version, entries: Mapping[CatalogReference, Element], collector: DiagnosticCollector
) -> None:
    """Report violations of the rules in a scenario and in the catalog entries that it uses."""
    elements = [element for tree in (root, *entries.values()) for element in tree.walk()]
    check_values(elements, version, collector)
    check_types(elements, collector)
    check_names(root, elements, version, entries, collector)


def check_values(elements: Sequence[Element], version: Version, collector: DiagnosticCollector) -> None:
    """Report elements with contradictory values or unusable numbers."""
    reported = {(diagnostic.source, diagnostic.line) for diagnostic in collector.errors}
    for element in elements:
        check = _CHECKS.get(type(element))
        message = unusable(element, version) or (check(element) if check else "")
        if message and (element.source, element.line) not in reported:
            collector.error(message, source=element.source, line=element.line)
        if isinstance(element, Orientation) and element == _EMPTY_ORIENTATION:
            message = "Orientation is empty, which by the standard is heading 0 of the world frame"
            hint = 'omit it, or write type="relative", for the heading of the road'
            collector.warning(message, hint, source=element.source, line=element.line)


def _distance(action: LongitudinalDistanceAction) -> str:
    count = sum(value is not None for value in (action.distance, action.time_gap))
    return "" if count == 1 else "LongitudinalDistanceAction must have either distance or timeGap"


def _lane_position(position: RelativeLanePosition) -> str:
    both = position.ds is not None and position.ds_lane is not None
    return "RelativeLanePosition must have either ds or dsLane" if both else ""


def _layer(element: AbsoluteTargetLane | LanePosition | PreferredLaneLayerAction | RelativeTargetLane) -> str:
    if element.layer is not LaneLayerType.TEMPORARY:
        return ""
    return f"{type(element).__name__} refers to the temporary lane layer, which road networks do not have here"


def _nurbs(curve: Nurbs) -> str:
    order: int | None = curve.order
    points, knots = len(curve.control_point or ()), [knot.value for knot in curve.knot or ()]
    if order is None or None in knots:
        return ""
    if order < 2:
        return f"Nurbs has the order {order}; it must be at least 2, the order of straight lines"
    if order > MAX_NURBS_ORDER:
        return f"Nurbs has the order {order}; it must be at most {MAX_NURBS_ORDER}"
    if points < order:
        return f"Nurbs of order {order} has {points} control points; at least {order} are required"
    if len(knots) != points + order:
        return f"Nurbs has {len(knots)} knots; {points} control points of order {order} require {points + order}"
    if any(after < before for before, after in pairwise(knots)):
        return "Nurbs has descending knots; each must be at least the previous one"
    if knots[order - 1] == knots[points]:
        return f"Nurbs has no extent: its knots {order} to {points + 1} are all {knots[points]:g}"
    return _descending_times([point.time for point in curve.control_point])


def _polyline(line: Polyline) -> str:
    return _descending_times([vertex.time for vertex in line.vertex or ()])


def _clothoid(curve: Clothoid) -> str:
    return _descending_times([curve.start_time, curve.stop_time])


def _clothoid_spline(curve: ClothoidSpline) -> str:
    return _descending_times([*(segment.time_start for segment in curve.clothoid_spline_segment or ()), curve.time_end])


def _descending_times(times: Sequence[float | None]) -> str:
    for before, after in pairwise([time for time in times if time is not None]):
        if after < before:
            return f"times of the trajectory descend from {before:g} s to {after:g} s; they must ascend"
    return ""


def _delay(condition: Condition) -> str:
    return "Condition has a negative delay" if condition.delay is not None and condition.delay < 0 else ""


def _transition(dynamics: TransitionDynamics) -> str:
    """Return the error of a negative duration or distance; the sign of a rate has no effect."""
    if dynamics.value is None or dynamics.value >= 0 or dynamics.dynamics_dimension is DynamicsDimension.RATE:
        return ""
    return f"a transition cannot take {dynamics.value:g} {'s' if _takes_time(dynamics) else 'm'}"


def _takes_time(dynamics: TransitionDynamics) -> bool:
    return dynamics.dynamics_dimension is DynamicsDimension.TIME


def _timing(timing: Timing) -> str:
    is_invalid = timing.scale is not None and timing.scale <= 0
    return f"Timing has the scale {timing.scale:g}; it must be above 0" if is_invalid else ""


_CHECKS: Mapping[type[Element], Callable[[Any], str]] = {
    AbsoluteTargetLane: _layer,
    Clothoid: _clothoid,
    ClothoidSpline: _clothoid_spline,
    Condition: _delay,
    LanePosition: _layer,
    LongitudinalDistanceAction: _distance,
    Nurbs: _nurbs,
    Polyline: _polyline,
    PreferredLaneLayerAction: _layer,
    RelativeLanePosition: _lane_position,
    RelativeTargetLane: _layer,
    Timing: _timing,
    TransitionDynamics: _transition,
}
