"""Checks of the places at which vehicles start, and of the speeds that they get.

A vehicle that drives itself must not start inside of another body or off the road, and without a speed it stands until
the end of the run. Files place scripted vehicles out of the way on purpose: far from all roads, below them, or on a
parking lot. Such a place is doubtful only if the vehicle is on a road in plan view and in height, or if it moves from
the start beside a road.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.driving.station_warnings import MARGIN
from eidrive_scenario.errors import MAX_DIAGNOSTICS, Diagnostic, SettingError, quoted
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.kinematics.trailers import declared_trailer
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.world import World
from eidrive_scenario.world.view import WorldView

MOST_OTHERS = 20
"""Maximum number of further actors that are counted for each one that starts inside of another."""
_TOUCH = 0.02
"""Depth up to which two bodies touch, but do not overlap [m]."""
_LOW = 0.2
"""Height up to which a vehicle drives over an object [m]."""


def check_spawns(scenario: Scenario, roads: RoadNetwork | None, world: World, drivers: Collection[str]) -> None:
    """Raise SettingError with every vehicle that drives itself and starts inside of another actor or off the road.

    world    state after Init
    drivers  vehicles that a driving stack drives
    """
    if not drivers:
        return
    view = world.poses()
    present = [name for name in scenario.entities if name in view.rows and name in drivers]
    diagnostics = [*overlapping_spawns(scenario, view, present), *_off_road(scenario, roads, view, present)]
    if diagnostics:
        raise SettingError(diagnostics)


def overlapping_spawns(
    scenario: Scenario, view: WorldView, names: Collection[str], among: Collection[str] | None = None
) -> Iterator[Diagnostic]:
    """Yield those of these actors that overlap another one; a pair of them is one diagnostic.

    Vehicle and trailers of a train do not count. `among` limits the other actors; None: all that are present. The
    number of diagnostics and of the others in each is limited: of actors at one place, all pairs overlap.
    """
    present = [name for name in scenario.entities if name in view.rows and (among is None or name in among)]
    boxes = {name: _core(view.plain_boxes[view.rows[name]]) for name in present}
    table = np.reshape([boxes[name] for name in present], (-1, 7))
    cos, sin = np.abs(np.cos(table[:, 6])), np.abs(np.sin(table[:, 6]))
    reach_x = (table[:, 3] * cos + table[:, 4] * sin + _TOUCH) / 2.0
    reach_y = (table[:, 3] * sin + table[:, 4] * cos + _TOUCH) / 2.0
    rows = {name: row for row, name in enumerate(present)}
    trains = _trains(scenario)
    done: set[str] = set()
    yielded = 0
    for name in names:
        done.add(name)
        train, row = trains.get(name, name), rows[name]
        apart = np.abs(table[:, :2] - table[row, :2])
        is_far = (apart[:, 0] > reach_x + reach_x[row]) | (apart[:, 1] > reach_y + reach_y[row])
        candidates = (other for other in map(present.__getitem__, (~is_far).nonzero()[0]) if other not in done)
        overlapping = (
            other for other in candidates if trains.get(other, other) != train and overlap(boxes[name], boxes[other])
        )
        others = list(islice(overlapping, MOST_OTHERS + 2))
        if others:
            x, y, *_ = boxes[others[0]]
            count = f"{len(others) - 1}" if len(others) < MOST_OTHERS + 2 else f"more than {MOST_OTHERS}"
            more = f", and of {count} more" if len(others) > 1 else ""
            message = f"{quoted(name)} starts inside of {quoted(others[0])}, whose center is at ({x:.1f}, {y:.1f}) m"
            yield start_diagnostic(scenario, name, message + more, "move one of them")
            yielded += 1
            if yielded == MAX_DIAGNOSTICS:
                yield start_diagnostic(scenario, name, "further actors that start inside of others are not listed", "")
                return


def _core(box: Sequence[float]) -> list[float]:
    """Return a box without its lowest part, and without the margin in which bodies touch."""
    x, y, z, length, width, height, yaw = box
    return [x, y, z + _LOW / 2.0, length - _TOUCH, width - _TOUCH, max(height - _LOW, 0.0), yaw]


def _trains(scenario: Scenario) -> Mapping[str, str]:
    """Return the foremost vehicle of each trailer."""
    front = {
        trailer: name for name, entity in scenario.entities.items() if (trailer := declared_trailer(entity)) is not None
    }
    trains = {}
    for trailer, towing in front.items():
        seen = {trailer}
        while towing in front and towing not in seen:
            seen.add(towing)
            towing = front[towing]
        trains[trailer] = towing
    return trains


def _off_road(
    scenario: Scenario, roads: RoadNetwork | None, view: WorldView, names: Sequence[str]
) -> Iterator[Diagnostic]:
    """Yield the actors that start farther than `MARGIN` from every lane."""
    if roads is None or not names:
        return
    x, y = np.array([view.plain_boxes[view.rows[name]][:2] for name in names]).T
    outside = roads.locate(x, y, reach=np.inf).outside.tolist()
    for name, gap, start_x, start_y in zip(names, outside, x.tolist(), y.tolist(), strict=True):
        if gap > MARGIN:
            message = f"{quoted(name)} starts at ({start_x:.1f}, {start_y:.1f}) m, {gap:.0f} m off the nearest road"
            yield start_diagnostic(scenario, name, message, "give a LanePosition, or a world position on a lane")


def start_diagnostic(scenario: Scenario, name: str, message: str, hint: str) -> Diagnostic:
    """Return a diagnostic at the last TeleportAction of an actor in Init, or at the actor without one."""
    element: model.Element = scenario.entities[name]
    selections = EntitySelections(scenario)
    for private in scenario.storyboard.init.actions.private:
        if name in selections.members(private.entity_ref):
            for action in private.private_action:
                if action.teleport_action is not None:
                    element = action.teleport_action
    return Diagnostic.at(element, message, hint)


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
        if isinstance(entity, model.Vehicle) and name in view.rows and name not in drivers
    ]
    if not names:
        return
    gaps = _gaps(roads, view, names)
    on_road = [name for name in names if gaps[name] <= MARGIN]
    yield from overlapping_spawns(scenario, view, on_road, among=[*on_road, *drivers])
    guided = _performers(scenario, lambda element: isinstance(element, model.FollowTrajectoryAction))
    for name in names:
        moving = abs(float(view.speed[view.rows[name]])) >= MOVING
        if moving and MARGIN < gaps[name] <= BESIDE and name not in guided:
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
    locations = roads.locate(x, y, reach=np.inf)
    gaps = {}
    for number, (name, row) in enumerate(zip(names, rows, strict=True)):
        location = locations.location(number)
        if location is None:
            gaps[name] = np.inf
            continue
        surface = roads.road_pose_at(location.road, location.s, location.t).z
        near = abs(float(view.position[row, 2]) - surface) <= HEIGHT
        gaps[name] = float(locations.outside[number]) if near else np.inf
    return gaps


def _performers(scenario: Scenario, is_wanted: Callable[[model.Element], bool]) -> frozenset[str]:
    """Return the entities that may perform an action with such an element, in Init or in an event."""
    selections, names = EntitySelections(scenario), set[str]()
    for private in scenario.storyboard.init.actions.private:
        if any(map(is_wanted, private.walk())):
            names.update(selections.members(private.entity_ref))
    for group in _groups(scenario):
        if any(map(is_wanted, _elements(scenario, group))):
            names.update(_actors(scenario, selections, group))
    return frozenset(names)


_PLANNER = "planner"


def check_destinations(
    scenario: Scenario, undirected: Collection[str], view: WorldView, commands: Commands
) -> tuple[Diagnostic, ...]:
    """Return a warning for each driven vehicle that gets a speed neither at the start nor from settings nor an action.

    undirected  vehicles whose settings determine no speed
    view        state after Init
    commands    of Init

    Raise SettingError for those whose planner the scenario selects. A vehicle with the default planner may be one that
    only perceives.
    """
    waiting = [name for name in scenario.entities if name in undirected and _waits(scenario, name, view, commands)]
    if not waiting:
        return ()
    moved = _moved(scenario)
    left = [name for name in waiting if name not in moved]
    diagnostics = {name: _diagnostic(scenario, name, commands) for name in left}
    errors = [diagnostics[name] for name in left if _planner_line(scenario, name) is not None]
    if errors:
        raise SettingError(errors)
    return tuple(diagnostics.values())


def _waits(scenario: Scenario, name: str, view: WorldView, commands: Commands) -> bool:
    """Return whether a vehicle is driven, or is added later, and neither moves after Init nor has to."""
    if name not in view.rows:
        return name in _added(scenario)
    goal = commands.goals.get(name)
    wanted = 0.0 if goal is None or goal.speed is None else goal.speed
    return name in commands.driven and wanted <= 0.0 and float(view.speed[view.rows[name]]) <= 0.0


def _added(scenario: Scenario) -> frozenset[str]:
    """Return the entities that events add to the world."""
    selections, names = EntitySelections(scenario), set[str]()
    for group in _groups(scenario):
        for element in _elements(scenario, group):
            if isinstance(element, model.EntityAction) and element.add_entity_action is not None:
                names.update(selections.members(element.entity_ref))
            elif isinstance(element, model.TeleportAction):
                names.update(_actors(scenario, selections, group))
    return frozenset(names)


def _moved(scenario: Scenario) -> frozenset[str]:
    """Return the entities of which an action requests a speed, or which one may move otherwise."""
    own = registry("actions")
    if any(command.type in own for command in scenario.custom_commands):
        return frozenset(scenario.entities)
    return _performers(scenario, lambda element: isinstance(element, model.PrivateAction) and _moves(element))


def _moves(action: model.PrivateAction) -> bool:
    """Whether an action requests a speed, overrides pedals, or assigns another controller.

    Routes have no speed, trajectories with times have one.
    """
    longitudinal, control, routing = action.longitudinal_action, action.controller_action, action.routing_action
    if longitudinal is not None:
        speed = longitudinal.speed_action
        absolute = None if speed is None else speed.speed_action_target.absolute_target_speed
        return absolute is None or absolute.value != 0.0
    if control is not None:
        return control.override_controller_value_action is not None or control.assign_controller_action is not None
    follow = routing.follow_trajectory_action if routing is not None else None
    return action.synchronize_action is not None or (follow is not None and follow.time_reference.timing is not None)


def _groups(scenario: Scenario) -> Iterator[model.ManeuverGroup]:
    for story in scenario.storyboard.story:
        for act in story.act:
            yield from act.maneuver_group


def _elements(scenario: Scenario, group: model.ManeuverGroup) -> Iterator[model.Element]:
    """Yield the elements of a maneuver group, and those of its maneuvers of catalogs."""
    for element in group.walk():
        yield element
        entry = scenario.entries.get(element) if isinstance(element, model.CatalogReference) else None
        if entry is not None:
            yield from entry.walk()


def _actors(scenario: Scenario, selections: EntitySelections, group: model.ManeuverGroup) -> Collection[str]:
    """Return the entities that may be actors of a group."""
    if group.actors.select_triggering_entities:
        return list(scenario.entities)
    return [name for ref in group.actors.entity_ref for name in selections.members(ref.entity_ref)]


def _diagnostic(scenario: Scenario, name: str, commands: Commands) -> Diagnostic:
    controller = [*filter(is_agent_controller, scenario.controllers[name])][-1]
    entries = {entry.name: entry.value for entry in property_entries(controller)}
    goal = commands.goals.get(name)
    routed = goal is not None and (goal.path is not None or goal.waypoints is not None)
    what = "has a route, but no speed" if routed else "has no destination"
    planner = f"planner {quoted(entries[_PLANNER])}" if _PLANNER in entries else "the default planner"
    message = f"{planner} of {quoted(name)} {what}: {name} stands for the whole run"
    hint = "give it a SpeedAction, target_speed or follow_speed_limit; planner none for a vehicle that is parked"
    if scenario.road_file is None:
        hint = "without roads there is no speed limit: give it a SpeedAction or target_speed"
    return Diagnostic(message, hint, controller.source, _planner_line(scenario, name) or controller.line)


def _planner_line(scenario: Scenario, name: str) -> int | None:
    """Return the line of the property that selects the planner of a vehicle; None for the default planner."""
    controller = [*filter(is_agent_controller, scenario.controllers[name])][-1]
    return next((entry.line for entry in property_entries(controller) if entry.name == _PLANNER), None)
