"""Rules on places: roads, lanes and signals that the road network does not have."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.scenario_rules import at
from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario.model import (
    LaneChangeAction,
    LanePosition,
    RoadPosition,
    TrafficSignalCondition,
    TrafficSignalState,
    TrafficSignalStateAction,
)

BEYOND = 0.01
"""Roads are as long as their files round them [m]."""
_ADDRESS = "="
"""ScenarioRunner addresses signals as `pos=x,y` or `id=7`."""


def missing_places(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A position on a road or lane that is not there."""
    seen: set[Diagnostic] = set()
    for error in context.unresolved.values():
        for diagnostic in error.diagnostics:
            if diagnostic not in seen:
                seen.add(diagnostic)
                yield diagnostic


def beyond_ends(context: RoadLintContext) -> Iterator[Diagnostic]:
    """An s before the start or beyond the end of its road: the engine takes the end, as others do."""
    for element in context.elements:
        if context.roads is None or not isinstance(element, LanePosition | RoadPosition):
            continue
        road = context.roads.roads.get(element.road_id)
        if road is not None and not -BEYOND <= element.s <= road.length + BEYOND:
            what = f"s = {element.s:g} lies beyond road {road.id!r}, which is {road.length:.2f} m long"
            yield at(element, what, "its end is meant; give an s on the road")


def missing_lanes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A change to a lane that no road has."""
    if context.roads is None:
        return
    known = {str(number) for road in context.roads.roads.values() for part in road.sections for number in part.lanes}
    for element in context.elements:
        target = element.lane_change_target.absolute_target_lane if isinstance(element, LaneChangeAction) else None
        if target is not None and target.value.strip() not in known - {"0"}:
            shown = ", ".join(sorted(known - {"0"}, key=int))
            yield at(target, f"no road has a lane {target.value!r}", f"lanes of the roads are {shown}")


def missing_signals(context: RoadLintContext) -> Iterator[Diagnostic]:
    """A traffic signal that the road network does not have."""
    if context.roads is None:
        return
    known = set(context.roads.signals)
    for element in context.elements:
        if isinstance(element, TrafficSignalState):
            name = element.traffic_signal_id
        elif isinstance(element, TrafficSignalStateAction | TrafficSignalCondition):
            name = element.name
        else:
            continue
        if name not in known and _ADDRESS not in name:
            hint = suggestion(name, known) if known else "the road file declares none"
            yield at(element, f"the road network has no traffic signal {name!r}", hint)
