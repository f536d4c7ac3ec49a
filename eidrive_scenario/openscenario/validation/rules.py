"""Rules that the schema cannot express: contradictory values, unusable numbers, values of other than the declared type.

The rules apply to incompletely read scenarios too: a field may be missing if the reader has reported an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from eidrive_scenario.errors import counted
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.validation.names import check_names
from eidrive_scenario.openscenario.values.parameters import TYPES, fits_type
from eidrive_scenario.openscenario.values.scalars import Version

_WITHOUT_NUMBERS = (model.ParameterType.BOOLEAN, model.ParameterType.DATE_TIME, model.ParameterType.STRING)
_WHOLE_NUMBERS = (
    model.ParameterType.INT,
    model.ParameterType.INTEGER,
    model.ParameterType.UNSIGNED_INT,
    model.ParameterType.UNSIGNED_SHORT,
)
_TRUTH = ("true", "false")
"""Boolean texts, which are compared case-insensitively, as Python capitalizes them."""


def check_types(elements: Iterable[model.Element], collector: DiagnosticCollector) -> None:
    """Warn of values and calculations that contradict the declared type."""
    elements = tuple(elements)
    types: dict[tuple[str, str], set[model.ParameterType]] = {}
    for element in elements:
        if isinstance(element, model.VariableDeclaration):
            types.setdefault(("variable", element.name), set()).add(element.variable_type)
            if _misfits(element.value, element.variable_type):
                declared = element.variable_type.value
                message = f"variable {element.name!r} is declared as {declared}, but its value is {element.value!r}"
                collector.warning(message, "the value is used as a text", at=element)
        elif isinstance(element, model.ParameterDeclaration):
            types.setdefault(("parameter", element.name), set()).add(element.parameter_type)
    for element in elements:
        if isinstance(element, model.VariableAction):
            _check_action(element, "variable", element.variable_ref, types, collector)
        elif isinstance(element, model.ParameterAction):
            _check_action(element, "parameter", element.parameter_ref, types, collector)


def _check_action(
    action: model.VariableAction | model.ParameterAction,
    kind: str,
    name: str,
    types: Mapping[tuple[str, str], set[model.ParameterType]],
    collector: DiagnosticCollector,
) -> None:
    """Check one action; the type is unknown if a name has several declarations with different types."""
    if len(types.get((kind, name), ())) != 1:
        return
    (declared,) = types[kind, name]
    setting = action.set_action
    if setting is not None and _misfits(setting.value, declared):
        message = f"{kind} {name!r} is declared as {declared.value}, but set to {setting.value!r}"
        collector.warning(message, "the value is used as a text", at=setting)
    elif action.modify_action is not None and declared in _WITHOUT_NUMBERS:
        message = f"{kind} {name!r} is declared as {declared.value}, but modified as a number"
        collector.warning(message, "declare it as double", at=action)
    elif action.modify_action is not None and declared in _WHOLE_NUMBERS:
        for part in action.modify_action.walk():
            change = getattr(part, "value", None)
            if isinstance(change, float) and not change.is_integer():
                message = f"{kind} {name!r} is declared as {declared.value}, but modified by {change:g}"
                collector.warning(message, "a fraction of the result is kept; declare it as double", at=action)


def _misfits(text: object, declared: model.ParameterType) -> bool:
    """Whether a value is not of a type; values that could not be read are already reported."""
    if not isinstance(text, str) or not isinstance(declared, model.ParameterType):
        return False
    if declared is model.ParameterType.BOOLEAN and text.lower() in _TRUTH:
        return False
    return not fits_type(text, TYPES[declared])


MAX_ABSOLUTE = 1e9
"""Maximum absolute value of coordinates [m], times [s] and speeds [m/s]."""
MIN_POSITIVE = 1e-9
"""Minimum value of lengths and weights by which other numbers are divided, so that no quotient overflows."""
UNLIMITED: tuple[type[model.Element], ...] = (
    model.DynamicConstraints,
    model.Fog,
    model.Performance,
    model.Phase,
    model.Range,
    model.Stochastic,
    model.TrafficSinkAction,
)
"""Elements whose numbers are limits; an infinite number is no limit."""
_MOTION_LIMITS = (
    "max_speed",
    "max_acceleration",
    "max_deceleration",
    "max_acceleration_rate",
    "max_deceleration_rate",
)
NOT_NEGATIVE: Mapping[type[model.Element], tuple[str, ...]] = {
    model.AngleCondition: ("angle_tolerance",),
    model.AnimationAction: ("animation_duration",),
    model.Dimensions: ("length", "width", "height"),
    model.DynamicConstraints: _MOTION_LIMITS,
    model.EndOfRoadCondition: ("duration",),
    model.Fog: ("visual_range",),
    model.FollowTrajectoryAction: ("initial_distance_offset",),
    model.LaneOffsetActionDynamics: ("max_lateral_acc",),
    model.LightState: ("flashing_on_duration", "flashing_off_duration", "luminous_intensity"),
    model.LightStateAction: ("transition_time",),
    model.LongitudinalDistanceAction: ("distance", "time_gap"),
    model.OffroadCondition: ("duration",),
    model.Performance: _MOTION_LIMITS,
    model.Phase: ("duration",),
    model.Precipitation: ("intensity", "precipitation_intensity"),
    model.ReachPositionCondition: ("tolerance",),
    model.RelativeAngleCondition: ("angle_tolerance",),
    model.RelativeClearanceCondition: ("distance_forward", "distance_backward"),
    model.RoadCondition: ("friction_scale_factor",),
    model.SpeedProfileEntry: ("time",),
    model.StandStillCondition: ("duration",),
    model.Sun: ("intensity", "illuminance"),
    model.SynchronizeAction: ("target_tolerance", "target_tolerance_master"),
    model.TargetDistanceSteadyState: ("distance",),
    model.TargetTimeSteadyState: ("time",),
    model.TrafficSignalController: ("delay",),
    model.Weather: ("temperature", "atmospheric_pressure"),
    model.Wind: ("speed",),
}
"""Attributes that must be at least 0 by the reference of the standard."""
POSITIVE: Mapping[type[model.Element], tuple[str, ...]] = {
    model.Axle: ("wheel_diameter",),
    model.Clothoid: ("length",),
    model.ClothoidSplineSegment: ("length",),
    model.ControlPoint: ("weight",),
}
"""Attributes that must be above 0: at least MIN_POSITIVE."""


def unusable(element: model.Element, version: Version) -> str:
    """Return the error of the first unusable number of an element, with the expected value; "" if there is none."""
    kind = type(element)
    for name, value in vars(element).items():
        if not isinstance(value, float):
            continue
        expected = ""
        if math.isnan(value):
            expected = "a number"
        elif abs(value) > MAX_ABSOLUTE and not _may_be_immense(element, name):
            expected = f"a number within {MAX_ABSOLUTE:g}"
        elif value < 0.0 and name in NOT_NEGATIVE.get(kind, ()):
            expected = "a number of at least 0"
        elif value < MIN_POSITIVE and name in POSITIVE.get(kind, ()):
            expected = "a number above 0" if value <= 0.0 else f"a number of at least {MIN_POSITIVE:g}"
        if expected:
            attributes = rules(kind, version).attributes.items()
            spelling = next((spelling for spelling, rule in attributes if rule.field == name), name)
            number = f"{value:g}".replace("inf", "INF").replace("nan", "NaN")
            return f"{spelling} of {kind.__name__} is {number}; {expected} is expected"
    return ""


def _may_be_immense(element: model.Element, name: str) -> bool:
    """Whether a number may be infinite: limits, values of conditions, and the rate of a step."""
    if isinstance(element, model.TransitionDynamics):
        return element.dynamics_dimension is model.DynamicsDimension.RATE
    if name == "delay":
        return False
    kind = type(element)
    is_compared = kind.__name__.endswith("Condition") and kind is not model.RoadCondition
    return is_compared or isinstance(element, UNLIMITED) or name.startswith("max_")


MAX_NURBS_ORDER = 20
"""Maximum order of a Nurbs. The time per sample grows with its square; roads and maneuvers have orders up to 6."""
_EMPTY_ORIENTATION = model.Orientation()


def check_rules(
    root: model.OpenScenario,
    version: Version,
    entries: Mapping[model.CatalogReference, model.Element],
    collector: DiagnosticCollector,
) -> None:
    """Report violations of the rules in a scenario and in the catalog entries that it uses."""
    elements = [element for tree in (root, *entries.values()) for element in tree.walk()]
    check_values(elements, version, collector)
    check_types(elements, collector)
    check_names(root, elements, version, entries, collector)


def check_values(elements: Sequence[model.Element], version: Version, collector: DiagnosticCollector) -> None:
    """Report elements with contradictory values or unusable numbers."""
    reported = {(diagnostic.source, diagnostic.line) for diagnostic in collector.errors}
    for element in elements:
        check = _CHECKS.get(type(element))
        message = unusable(element, version) or (check(element) if check else "")
        if message and (element.source, element.line) not in reported:
            collector.error(message, at=element)
        if isinstance(element, model.Orientation) and element == _EMPTY_ORIENTATION:
            message = "Orientation is empty, which before version 1.3 is heading 0 of the world frame"
            hint = 'omit it, or write type="relative", for the heading of the road'
            collector.warning(message, hint, at=element)


def _distance(action: model.LongitudinalDistanceAction) -> str:
    count = sum(value is not None for value in (action.distance, action.time_gap))
    return "" if count == 1 else "LongitudinalDistanceAction must have either distance or timeGap"


def _lane_position(position: model.RelativeLanePosition) -> str:
    both = position.ds is not None and position.ds_lane is not None
    return "RelativeLanePosition must have either ds or dsLane" if both else ""


def _layer(
    element: model.AbsoluteTargetLane | model.LanePosition | model.PreferredLaneLayerAction | model.RelativeTargetLane,
) -> str:
    if element.layer is not model.LaneLayerType.TEMPORARY:
        return ""
    return f"{type(element).__name__} refers to the temporary lane layer, which road networks do not have here"


def _nurbs(curve: model.Nurbs) -> str:
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
        required = f"{points} control points of order {order} require {points + order}"
        return f"Nurbs has {counted(len(knots), 'knot')}; {required}"
    if any(after < before for before, after in pairwise(knots)):
        return "Nurbs has descending knots; each must be at least the previous one"
    if knots[order - 1] == knots[points]:
        return f"Nurbs has no extent: its knots {order} to {points + 1} are all {knots[points]:g}"
    return _descending_times([point.time for point in curve.control_point])


def _clothoid_spline(curve: model.ClothoidSpline) -> str:
    return _descending_times([*(segment.time_start for segment in curve.clothoid_spline_segment or ()), curve.time_end])


def _descending_times(times: Sequence[float | None]) -> str:
    for before, after in pairwise([time for time in times if time is not None]):
        if after < before:
            return f"times of the trajectory descend from {before:g} s to {after:g} s; they must ascend"
    return ""


def _transition(dynamics: model.TransitionDynamics) -> str:
    """Return the error of a negative duration or distance; the sign of a rate has no effect."""
    if dynamics.value is None or dynamics.value >= 0 or dynamics.dynamics_dimension is model.DynamicsDimension.RATE:
        return ""
    unit = "s" if dynamics.dynamics_dimension is model.DynamicsDimension.TIME else "m"
    return f"a transition cannot take {dynamics.value:g} {unit}"


def _timing(timing: model.Timing) -> str:
    is_invalid = timing.scale is not None and timing.scale <= 0
    return f"Timing has the scale {timing.scale:g}; it must be above 0" if is_invalid else ""


_CHECKS: Mapping[type[model.Element], Callable[[Any], str]] = {
    model.AbsoluteTargetLane: _layer,
    model.Clothoid: lambda curve: _descending_times([curve.start_time, curve.stop_time]),
    model.ClothoidSpline: _clothoid_spline,
    model.Condition: lambda condition: (
        "Condition has a negative delay" if condition.delay is not None and condition.delay < 0 else ""
    ),
    model.LanePosition: _layer,
    model.LongitudinalDistanceAction: _distance,
    model.Nurbs: _nurbs,
    model.Polyline: lambda line: _descending_times([vertex.time for vertex in line.vertex or ()]),
    model.PreferredLaneLayerAction: _layer,
    model.RelativeLanePosition: _lane_position,
    model.RelativeTargetLane: _layer,
    model.Timing: _timing,
    model.TransitionDynamics: _transition,
}
