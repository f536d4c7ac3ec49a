"""What the schema cannot say but is wrong all the same: double names, dangling ones, values that exclude others.

The rules look at a scenario as far as it could be read, so a field may be missing where the reader has complained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from eidrive_scenario.openscenario.findings import Findings
from eidrive_scenario.openscenario.model import (
    Action,
    CatalogReference,
    Condition,
    Element,
    LongitudinalDistanceAction,
    Nurbs,
    ObjectController,
    OpenScenario,
    RelativeLanePosition,
)
from eidrive_scenario.openscenario.model.content import Changed, Choice, Sequence
from eidrive_scenario.openscenario.model.element import alternatives
from eidrive_scenario.openscenario.names import check_names
from eidrive_scenario.openscenario.scalars import Version, parsed
from eidrive_scenario.openscenario.schema import rules


def check_rules(
    root: OpenScenario, version: Version, entries: Mapping[CatalogReference, Element], findings: Findings
) -> None:
    """Reports whatever breaks a rule in a scenario or in the catalog entries that it uses."""
    elements = [element for tree in (root, *entries.values()) for element in tree.walk()]
    _check_choices(elements, version, findings)
    for element in elements:
        check = _CHECKS.get(type(element))
        message = check(element) if check else ""
        if message:
            findings.error(message, source=element.source, line=element.line)
    check_names(root, elements, version, entries, findings)


def _check_choices(elements: Iterable[Element], version: Version, findings: Findings) -> None:
    """Up to 1.2 the schema lets an element choose nothing.

    That is in use for an action that does nothing and for an object without controller; elsewhere it has no meaning.
    """
    for element in elements:
        allowed = _must_choose(type(element), version)
        if allowed and not any(getattr(element, name) for name in allowed):
            report = findings.warn if isinstance(element, _MAY_BE_EMPTY) else findings.error
            report(
                f"{type(element).__name__} is empty",
                "it holds one of " + ", ".join(allowed.values()),
                source=element.source,
                line=element.line,
            )


def _must_choose(cls: type[Element], version: Version) -> Mapping[str, str]:
    """The children of which one has to be there though the schema does not say so: fields and their spelling."""
    key = (cls, version)
    known = _CHOICES.get(key)
    if known is None:
        model = cls.content_model
        if isinstance(model, Changed):
            lenient = version < parsed(model.since)
        else:
            parts = model.parts if isinstance(model, Sequence) else (model,)
            lenient = any(
                isinstance(part, Choice) and bool(part.empty_until) and version <= parsed(part.empty_until)
                for part in parts
            )
        spelled = {child.field: name for name, child in rules(cls, version).children.items()}
        named = {name: spelled[name] for name in alternatives(cls) if name in spelled}
        known = _CHOICES[key] = named if lenient else {}
    return known


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
_MAY_BE_EMPTY = (Action, ObjectController)
_CHOICES: dict[tuple[type[Element], Version], Mapping[str, str]] = {}
