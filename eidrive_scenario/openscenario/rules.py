"""What the schema cannot say but is wrong all the same: double names, dangling ones, values that exclude others.

The rules look at a scenario as far as it could be read, so a field may be missing where the reader has complained.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from eidrive_scenario.openscenario.findings import Findings
from eidrive_scenario.openscenario.model import (
    CatalogReference,
    Condition,
    DynamicsDimension,
    Element,
    LongitudinalDistanceAction,
    Nurbs,
    OpenScenario,
    RelativeLanePosition,
    Timing,
    TransitionDynamics,
)
from eidrive_scenario.openscenario.names import check_names
from eidrive_scenario.openscenario.scalars import Version
from eidrive_scenario.openscenario.schema import rules


def check_rules(
    root: OpenScenario, version: Version, entries: Mapping[CatalogReference, Element], findings: Findings
) -> None:
    """Reports whatever breaks a rule in a scenario or in the catalog entries that it uses."""
    elements = [element for tree in (root, *entries.values()) for element in tree.walk()]
    flawed = {(problem.source, problem.line) for problem in findings.problems}
    for element in elements:
        check = _CHECKS.get(type(element))
        message = _no_number(element, version) or (check(element) if check else "")
        if message and (element.source, element.line) not in flawed:
            findings.error(message, source=element.source, line=element.line)
    check_names(root, elements, version, entries, findings)


def _no_number(element: Element, version: Version) -> str:
    """The schema counts NaN among the numbers; no attribute of the standard can mean it."""
    for name, value in vars(element).items():
        if isinstance(value, float) and math.isnan(value):
            known = rules(type(element), version).attributes.items()
            spelling = next((spelling for spelling, rule in known if rule.field == name), name)
            return f"{spelling} of {type(element).__name__} is NaN; give a number"
    return ""


def _distance(action: LongitudinalDistanceAction) -> str:
    given = sum(value is not None for value in (action.distance, action.time_gap))
    return "" if given == 1 else "LongitudinalDistanceAction has to have either distance or timeGap"


def _lane_position(position: RelativeLanePosition) -> str:
    both = position.ds is not None and position.ds_lane is not None
    return "RelativeLanePosition has to have either ds or dsLane" if both else ""


def _nurbs(curve: Nurbs) -> str:
    order: int | None = curve.order
    points, knots = len(curve.control_point or ()), len(curve.knot or ())
    if order is None or (points >= order and knots == points + order):
        return ""
    if points < order:
        return f"Nurbs of order {order} has {points} control points; it has to have at least {order}"
    return f"Nurbs has {knots} knots; {points} control points of order {order} want {points + order}"


def _delay(condition: Condition) -> str:
    return "Condition has a negative delay" if condition.delay is not None and condition.delay < 0 else ""


def _transition(dynamics: TransitionDynamics) -> str:
    """A rate may have a sign in practice: it does not matter."""
    if dynamics.value is None or dynamics.value >= 0 or dynamics.dynamics_dimension is DynamicsDimension.RATE:
        return ""
    return f"a transition cannot take {dynamics.value:g} {'s' if _takes_time(dynamics) else 'm'}"


def _takes_time(dynamics: TransitionDynamics) -> bool:
    return dynamics.dynamics_dimension is DynamicsDimension.TIME


def _timing(timing: Timing) -> str:
    wrong = timing.scale is not None and timing.scale <= 0
    return f"Timing has the scale {timing.scale:g}; it has to be above 0" if wrong else ""


_CHECKS: Mapping[type[Element], Callable[[Any], str]] = {
    Condition: _delay,
    LongitudinalDistanceAction: _distance,
    Nurbs: _nurbs,
    RelativeLanePosition: _lane_position,
    Timing: _timing,
    TransitionDynamics: _transition,
}
