"""Rules on places: roads, lanes and signals that the road network does not have."""

from __future__ import annotations

from collections.abc import Iterator

from eidrive_scenario.errors import Problem, suggestion
from eidrive_scenario.openscenario.lint import at
from eidrive_scenario.openscenario.model import (
    LaneChangeAction,
    LanePosition,
    RoadPosition,
    TrafficSignalCondition,
    TrafficSignalState,
    TrafficSignalStateAction,
)
from eidrive_scenario.storyboard.lint.survey import RoadSurvey

BEYOND = 0.01
"""Roads are as long as their files round them [m]."""
_ADDRESS = "="
"""ScenarioRunner addresses signals as `pos=x,y` or `id=7`."""


def missing_places(survey: RoadSurvey) -> Iterator[Problem]:
    """A position on a road or lane that is not there."""
    seen: set[Problem] = set()
    for error in survey.lost.values():
        for problem in error.problems:
            if problem not in seen:
                seen.add(problem)
                yield problem


def beyond_ends(survey: RoadSurvey) -> Iterator[Problem]:
    """An s before the start or beyond the end of its road: the engine takes the end, as others do."""
    for element in survey.elements:
        if survey.roads is None or not isinstance(element, LanePosition | RoadPosition):
            continue
        road = survey.roads.roads.get(element.road_id)
        if road is not None and not -BEYOND <= element.s <= road.length + BEYOND:
            what = f"s = {element.s:g} lies beyond road {road.id!r}, which is {road.length:.2f} m long"
            yield at(element, what, "its end is meant; give an s on the road")


def missing_lanes(survey: RoadSurvey) -> Iterator[Problem]:
    """A change to a lane that no road has."""
    if survey.roads is None:
        return
    known = {str(number) for road in survey.roads.roads.values() for part in road.sections for number in part.lanes}
    for element in survey.elements:
        target = element.lane_change_target.absolute_target_lane if isinstance(element, LaneChangeAction) else None
        if target is not None and target.value.strip() not in known - {"0"}:
            shown = ", ".join(sorted(known - {"0"}, key=int))
            yield at(target, f"no road has a lane {target.value!r}", f"lanes of the roads are {shown}")


def missing_signals(survey: RoadSurvey) -> Iterator[Problem]:
    """A traffic signal that the road network does not have."""
    if survey.roads is None:
        return
    known = set(survey.roads.signals)
    for element in survey.elements:
        if isinstance(element, TrafficSignalState):
            name = element.traffic_signal_id
        elif isinstance(element, TrafficSignalStateAction | TrafficSignalCondition):
            name = element.name
        else:
            continue
        if name not in known and _ADDRESS not in name:
            remedy = suggestion(name, known) if known else "the road file declares none"
            yield at(element, f"the road network has no traffic signal {name!r}", remedy)
