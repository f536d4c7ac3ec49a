"""Check of numbers that XML Schema allows but runs cannot use: NaN, infinite, too large, negative lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping

from eidrive_scenario.openscenario.model import (
    AngleCondition,
    AnimationAction,
    Axle,
    Clothoid,
    ClothoidSplineSegment,
    ControlPoint,
    Dimensions,
    DynamicConstraints,
    DynamicsDimension,
    Element,
    EndOfRoadCondition,
    Fog,
    FollowTrajectoryAction,
    LaneOffsetActionDynamics,
    LightState,
    LightStateAction,
    OffroadCondition,
    Performance,
    Phase,
    Precipitation,
    Range,
    ReachPositionCondition,
    RelativeAngleCondition,
    RelativeClearanceCondition,
    RoadCondition,
    SpeedProfileEntry,
    StandStillCondition,
    Stochastic,
    SynchronizeAction,
    TargetDistanceSteadyState,
    TargetTimeSteadyState,
    TrafficSignalController,
    TrafficSinkAction,
    TransitionDynamics,
    Wind,
)
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.values.scalars import Version

MAX_ABSOLUTE = 1e9
"""Maximum absolute value of coordinates [m], times [s] and speeds [m/s]."""
MIN_POSITIVE = 1e-9
"""Minimum value of lengths and weights by which other numbers are divided, so that no quotient overflows."""
UNLIMITED: tuple[type[Element], ...] = (
    DynamicConstraints,
    Fog,
    Performance,
    Phase,
    Range,
    Stochastic,
    TrafficSinkAction,
)
"""Elements whose numbers are limits; an infinite number is no limit."""
NOT_NEGATIVE: Mapping[type[Element], tuple[str, ...]] = {
    AngleCondition: ("angle_tolerance",),
    AnimationAction: ("animation_duration",),
    Dimensions: ("length", "width", "height"),
    DynamicConstraints: (
        "max_speed",
        "max_acceleration",
        "max_deceleration",
        "max_acceleration_rate",
        "max_deceleration_rate",
    ),
    EndOfRoadCondition: ("duration",),
    FollowTrajectoryAction: ("initial_distance_offset",),
    LaneOffsetActionDynamics: ("max_lateral_acc",),
    LightState: ("flashing_on_duration", "flashing_off_duration", "luminous_intensity"),
    LightStateAction: ("transition_time",),
    OffroadCondition: ("duration",),
    Performance: (
        "max_speed",
        "max_acceleration",
        "max_deceleration",
        "max_acceleration_rate",
        "max_deceleration_rate",
    ),
    Phase: ("duration",),
    Precipitation: ("intensity", "precipitation_intensity"),
    ReachPositionCondition: ("tolerance",),
    RelativeAngleCondition: ("angle_tolerance",),
    RelativeClearanceCondition: ("distance_forward", "distance_backward"),
    RoadCondition: ("friction_scale_factor",),
    SpeedProfileEntry: ("time",),
    StandStillCondition: ("duration",),
    SynchronizeAction: ("target_tolerance", "target_tolerance_master"),
    TargetDistanceSteadyState: ("distance",),
    TargetTimeSteadyState: ("time",),
    TrafficSignalController: ("delay",),
    Wind: ("speed",),
}
"""Attributes that must be at least 0 by the reference of the standard."""
POSITIVE: Mapping[type[Element], tuple[str, ...]] = {
    Axle: ("wheel_diameter",),
    Clothoid: ("length",),
    ClothoidSplineSegment: ("length",),
    ControlPoint: ("weight",),
}
"""Attributes that must be above 0: at least MIN_POSITIVE."""


def unusable(element: Element, version: Version) -> str:
    """Return the error of the first unusable number of an element, with the expected value; "" if there is none."""
    kind = type(element)
    for name, value in vars(element).items():
        if not isinstance(value, float):
            continue
        message = ""
        if math.isnan(value):
            message = "is NaN; a number is expected"
        elif abs(value) > MAX_ABSOLUTE and not _may_be_immense(element, name):
            message = f"is {_format(value)}; a number within {MAX_ABSOLUTE:g} is expected"
        elif value < 0.0 and name in NOT_NEGATIVE.get(kind, ()):
            message = f"is {_format(value)}; a number of at least 0 is expected"
        elif value <= 0.0 and name in POSITIVE.get(kind, ()):
            message = f"is {_format(value)}; a number above 0 is expected"
        elif value < MIN_POSITIVE and name in POSITIVE.get(kind, ()):
            message = f"is {_format(value)}; a number of at least {MIN_POSITIVE:g} is expected"
        if message:
            known = rules(kind, version).attributes.items()
            spelling = next((spelling for spelling, rule in known if rule.field == name), name)
            return f"{spelling} of {kind.__name__} {message}"
    return ""


def _may_be_immense(element: Element, name: str) -> bool:
    """Whether a number may be infinite: limits, values of conditions, and the rate of a step."""
    if isinstance(element, TransitionDynamics):
        return element.dynamics_dimension is DynamicsDimension.RATE
    if name == "delay":
        return False
    kind = type(element)
    is_compared = kind.__name__.endswith("Condition") and kind is not RoadCondition
    return is_compared or isinstance(element, UNLIMITED) or name.startswith("max_")


def _format(value: float) -> str:
    if math.isinf(value):
        return "INF" if value > 0.0 else "-INF"
    return f"{value:g}"
