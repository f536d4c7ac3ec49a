"""Rules about positions, lanes, signals and conflict areas that the road network does not contain."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.rule import at
from eidrive_scenario.driving.planning.area_checks import areas_off_road
from eidrive_scenario.driving.station_declarations import declared_settings
from eidrive_scenario.errors import Diagnostic, InputError, suggestion
from eidrive_scenario.openscenario.model import (
    LaneChangeAction,
    LanePosition,
    RoadPosition,
    TrafficSignalCondition,
    TrafficSignalState,
    TrafficSignalStateAction,
)

LENGTH_TOLERANCE = 0.01
"""Maximum rounding error of the length of a road in its file [m]."""
_ADDRESS = "="
"""Part of signal references of ScenarioRunner, such as `pos=x,y` or `id=7`."""


def unresolvable_positions(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield positions on a road or lane that does not exist."""
    seen: set[Diagnostic] = set()
    for error in context.unresolved.values():
        for diagnostic in error.diagnostics:
            if diagnostic not in seen:
                seen.add(diagnostic)
                yield diagnostic


def s_out_of_range(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield positions with an s outside the road; a run uses the end of the road, as other engines do."""
    for element in context.elements:
        if context.roads is None or not isinstance(element, LanePosition | RoadPosition):
            continue
        road = context.roads.roads.get(element.road_id)
        if road is not None and not -LENGTH_TOLERANCE <= element.s <= road.length + LENGTH_TOLERANCE:
            message = f"s = {element.s:g} is outside road {road.id!r}, which is {road.length:.2f} m long"
            yield at(element, message, "the end of the road is used; specify an s on the road")


def unknown_lanes(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield lane changes to a lane that no road has."""
    if context.roads is None:
        return
    known = {str(number) for road in context.roads.roads.values() for part in road.sections for number in part.lanes}
    for element in context.elements:
        target = element.lane_change_target.absolute_target_lane if isinstance(element, LaneChangeAction) else None
        if target is not None and target.value.strip() not in known - {"0"}:
            shown = ", ".join(sorted(known - {"0"}, key=int))
            yield at(target, f"lane {target.value!r} exists on no road", f"known: {shown}")


def unknown_signals(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield traffic signals that the road network does not contain."""
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
            hint = suggestion(name, known) if known else "the road file defines none"
            yield at(element, f"traffic signal {name!r} does not exist in the road network", hint)


def conflict_areas_off_road(context: RoadLintContext) -> Iterator[Diagnostic]:
    """Yield conflict areas without a part on a road; invalid settings are reported by the run setup."""
    try:
        settings = declared_settings(context.scenario, None, None)
    except InputError:
        return
    yield from areas_off_road(context.scenario, settings, context.roads)
