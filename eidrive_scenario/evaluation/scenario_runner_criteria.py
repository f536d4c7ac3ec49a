"""Translation of criteria of ScenarioRunner: registered name and settings for a condition in the stop trigger."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from eidrive_scenario.openscenario.conventions import CRITERION_PREFIX
from eidrive_scenario.openscenario.model import Condition


class Translation(NamedTuple):
    """Criterion for a class of ScenarioRunner.

    fixed      settings that agree with ScenarioRunner
    arguments  settings by argument of the class; the first one is that of a condition without a known argument
    """

    kind: str
    fixed: Mapping[str, Any] = {}
    arguments: Mapping[str, str] = {}


CLASSES: Mapping[str, Translation] = {
    "ActorBlockedTest": Translation("actor_blocked", arguments={"max_time": "at_most", "min_speed": "below"}),
    "AverageVelocityTest": Translation("average_speed", arguments={"velocity": "at_least"}),
    "CollisionTest": Translation("collision"),
    "DrivenDistanceTest": Translation("driven_distance", arguments={"distance": "at_least"}),
    "EndofRoadTest": Translation("end_of_road", arguments={"duration": "at_most"}),
    "InRouteTest": Translation("in_route", arguments={"offroad_max": "at_most", "offroad_min": "beyond"}),
    "KeepLaneTest": Translation("keep_lane"),
    "MaxVelocityTest": Translation("max_speed", arguments={"max_velocity": "at_most"}),
    "OffRoadTest": Translation("off_road", arguments={"duration": "at_most"}),
    "OnSidewalkTest": Translation("on_sidewalk", arguments={"duration": "at_most"}),
    "OutsideRouteLanesTest": Translation("outside_route_lanes"),
    "RouteCompletionTest": Translation("route_completion", fixed={"within": 10.0}),
    "RunningRedLightTest": Translation("running_red_light", fixed={"part": "rear"}),
    "RunningStopTest": Translation("running_stop_sign"),
    "WrongLaneTest": Translation("wrong_lane"),
    "YieldToEmergencyVehicleTest": Translation("yield_to_emergency_vehicle", arguments={"ev": "to"}),
}
"""Criteria by class of ScenarioRunner; SI units on both sides."""

INEXPRESSIBLE: Mapping[str, str] = {
    "InRadiusRegionTest": "reach_position: {of: Ego, x: 100, y: 20, within: 5}",
    "MinimumSpeedRouteTest": "average_speed: {of: Ego, at_least: 5}",
    "ReachedRegionTest": "reached_region: {of: Ego, region: [[100, 15], [110, 25]]}",
    "ScenarioTimeoutTest": "time_limit: {within: 60}",
}
"""Criteria to declare instead of classes whose arguments are not one number, all that such a condition can state."""

REQUIRED = ("DrivenDistanceTest", "MaxVelocityTest", "AverageVelocityTest", "YieldToEmergencyVehicleTest")
"""Classes that require a value; an empty one is an error."""


def translation(condition: Condition) -> tuple[str, dict[str, Any]] | None:
    """Return the name of the criterion and its settings; None for a class that is not supported."""
    name = condition.name.removeprefix(CRITERION_PREFIX)
    found = CLASSES.get(name)
    if found is None:
        return None
    settings = dict(found.fixed)
    by_value = condition.by_value_condition
    parameter = by_value.parameter_condition if by_value is not None else None
    value = parameter.value if parameter is not None else ""
    if found.arguments and (value or name in REQUIRED):
        argument = parameter.parameter_ref if parameter is not None else ""
        settings[found.arguments.get(argument, next(iter(found.arguments.values())))] = _number(value)
    return found.kind, settings


def _number(value: str) -> Any:
    try:
        return float(value)
    except ValueError:
        return value
