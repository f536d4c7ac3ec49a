"""Warnings about the places at which scripted vehicles start: inside of another vehicle, or beside the road.

Files place vehicles out of the way on purpose: far from all roads, below them, or on a parking lot. A place is
doubtful only if the vehicle is on a road in plan view and in height, or if it moves from the start beside a road.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from eidrive_scenario.driving.station_warnings import MARGIN
from eidrive_scenario.errors import Diagnostic, quoted
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import FollowTrajectoryAction, Vehicle
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation.spawn_checks import overlapping_spawns, start_diagnostic
from eidrive_scenario.world import World
from eidrive_scenario.world.view import WorldView

BESIDE = 30.0
"""Distance from the nearest lane from which a vehicle is out of the way on purpose [m]."""
HEIGHT = 1.0
"""Distance from the surface of the road from which a vehicle is above or below it on purpose [m]."""
MOVING = 0.1
"""Speed from which a vehicle moves at the start [m/s]."""


def spawn_warnings(
    scenario: Scenario, roads: RoadNetwork | None, world: World, drivers: Collection[str]
) -> Iterator[Diagnostic]:
    """Yield a warning for each pair of scripted vehicles that overlap, and for each one that moves beside the road.

    world    state after Init
    drivers  vehicles that a driving stack drives, whose places `check_spawns` has checked
    """
    view = world.poses()
    names = [
        name
        for name, entity in scenario.entities.items()
        if isinstance(entity, Vehicle) and name in view.rows and name not in drivers
    ]
    if not names:
        return
    gaps = _gaps(roads, view, names)
    on_road = [name for name in names if gaps[name] <= MARGIN]
    yield from overlapping_spawns(scenario, view, on_road, among=[*on_road, *drivers])
    on_trajectories = _on_trajectories(scenario)
    for name in names:
        moving = abs(float(view.speed[view.rows[name]])) >= MOVING
        if moving and MARGIN < gaps[name] <= BESIDE and name not in on_trajectories:
            x, y, *_ = view.plain_boxes[view.rows[name]]
            message = (
                f"{quoted(name)} starts at ({x:.1f}, {y:.1f}) m and moves, {gaps[name]:.0f} m off the nearest road"
            )
            yield start_diagnostic(scenario, name, message, "give a LanePosition, or a world position on a lane")


def _gaps(roads: RoadNetwork | None, view: WorldView, names: list[str]) -> dict[str, float]:
    """Return the distance of each vehicle from the nearest lane [m]: infinite above and below it, 0 without roads."""
    if roads is None:
        return dict.fromkeys(names, 0.0)
    rows = [view.rows[name] for name in names]
    x, y = np.array([view.plain_boxes[row][:2] for row in rows]).T
    found = roads.locate(x, y, reach=np.inf)
    gaps = {}
    for number, (name, row) in enumerate(zip(names, rows, strict=True)):
        place = found.location(number)
        if place is None:
            gaps[name] = np.inf
            continue
        surface = roads.road_pose_at(place.road, place.s, place.t).z
        near = abs(float(view.position[row, 2]) - surface) <= HEIGHT
        gaps[name] = float(found.outside[number]) if near else np.inf
    return gaps


def _on_trajectories(scenario: Scenario) -> frozenset[str]:
    """Return the entities that follow a trajectory at any time."""
    selections, found = EntitySelections(scenario), set[str]()
    storyboard = scenario.storyboard
    for private in storyboard.init.actions.private:
        if any(isinstance(element, FollowTrajectoryAction) for element in private.walk()):
            found.update(selections.members(private.entity_ref))
    for story in storyboard.story:
        for act in story.act:
            for group in act.maneuver_group:
                if any(isinstance(element, FollowTrajectoryAction) for element in group.walk()):
                    for actor in group.actors.entity_ref:
                        found.update(selections.members(actor.entity_ref))
    return frozenset(found)
