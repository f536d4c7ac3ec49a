"""Numbers that XML Schema allows and nobody can calculate with: NaN, infinite ones, immense ones, negative lengths."""

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

MOST = 1e9
"""No place is further away [m], no time later [s] than this, and nothing is faster [m/s]."""
UNLIMITED: tuple[type[Element], ...] = (
    DynamicConstraints,
    Fog,
    Performance,
    Phase,
    Range,
    Stochastic,
    TrafficSinkAction,
)
"""Whose numbers are bounds, so that one may be infinite: there is no bound."""
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
"""Attributes that the standard's reference counts from 0 on."""
POSITIVE: Mapping[type[Element], tuple[str, ...]] = {
    Axle: ("wheel_diameter",),
    Clothoid: ("length",),
    ClothoidSplineSegment: ("length",),
    ControlPoint: ("weight",),
}
"""Attributes that have to be above 0."""


def unusable(element: Element, version: Version) -> str:
    """What is wrong with a number of an element, and what would be right; "" if nothing is."""
    kind = type(element)
    for name, value in vars(element).items():
        if not isinstance(value, float):
            continue
        message = ""
        if math.isnan(value):
            message = "is NaN; give a number"
        elif abs(value) > MOST and not _may_be_immense(element, name):
            message = f"is {_spelled(value)}; nothing can be calculated with it, give a number within {MOST:g}"
        elif value < 0.0 and name in NOT_NEGATIVE.get(kind, ()):
            message = f"is {_spelled(value)}; give a number that is not negative"
        elif value <= 0.0 and name in POSITIVE.get(kind, ()):
            message = f"is {_spelled(value)}; give a number above 0"
        if message:
            known = rules(kind, version).attributes.items()
            spelling = next((spelling for spelling, rule in known if rule.field == name), name)
            return f"{spelling} of {kind.__name__} {message}"
    return ""


def _may_be_immense(element: Element, name: str) -> bool:
    """Limits and the values of conditions only compare; a change at an infinite rate is a step."""
    if isinstance(element, TransitionDynamics):
        return element.dynamics_dimension is DynamicsDimension.RATE
    if name == "delay":
        return False
    kind = type(element)
    compares = kind.__name__.endswith("Condition") and kind is not RoadCondition
    return compares or isinstance(element, UNLIMITED) or name.startswith("max_")


def _spelled(value: float) -> str:
    if math.isinf(value):
        return "INF" if value > 0.0 else "-INF"
    return f"{value:g}"
