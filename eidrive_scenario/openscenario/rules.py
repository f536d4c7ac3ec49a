"""What the schema cannot say but is wrong all the same: double names, dangling ones, values that exclude others.

The rules look at a scenario as far as it could be read, so a field may be missing where the reader has complained.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from eidrive_scenario.openscenario.findings import Findings
from eidrive_scenario.openscenario.model import (
    CatalogReference,
    Condition,
    Element,
    LongitudinalDistanceAction,
    Nurbs,
    OpenScenario,
    RelativeLanePosition,
)
from eidrive_scenario.openscenario.names import check_names
from eidrive_scenario.openscenario.scalars import Version


def check_rules(
    root: OpenScenario, version: Version, entries: Mapping[CatalogReference, Element], findings: Findings
) -> None:
    """Reports whatever breaks a rule in a scenario or in the catalog entries that it uses."""
    elements = [element for tree in (root, *entries.values()) for element in tree.walk()]
    flawed = {(problem.source, problem.line) for problem in findings.problems}
    for element in elements:
        check = _CHECKS.get(type(element))
        message = check(element) if check else ""
        if message and (element.source, element.line) not in flawed:
            findings.error(message, source=element.source, line=element.line)
    check_names(root, elements, version, entries, findings)


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


_CHECKS: Mapping[type[Element], Callable[[Any], str]] = {
    Condition: _delay,
    LongitudinalDistanceAction: _distance,
    Nurbs: _nurbs,
    RelativeLanePosition: _lane_position,
}
