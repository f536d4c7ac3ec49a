"""Check that every vehicle that drives itself can get a speed: without one it stands until the end of the run."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.model import (
    CatalogReference,
    Element,
    EntityAction,
    ManeuverGroup,
    PrivateAction,
    TeleportAction,
)
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.registry import registry
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.world.view import WorldView

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
    found = {name: _diagnostic(scenario, name, commands) for name in left}
    errors = [found[name] for name in left if _planner_line(scenario, name) is not None]
    if errors:
        raise SettingError(errors)
    return tuple(found.values())


def _waits(scenario: Scenario, name: str, view: WorldView, commands: Commands) -> bool:
    """Return whether a vehicle is driven, or is added later, and neither moves after Init nor has to."""
    if name not in view.rows:
        return name in _added(scenario)
    goal = commands.goals.get(name)
    wanted = 0.0 if goal is None or goal.speed is None else goal.speed
    return name in commands.driven and wanted <= 0.0 and float(view.speed[view.rows[name]]) <= 0.0


def _added(scenario: Scenario) -> frozenset[str]:
    """Return the entities that events add to the world."""
    selections, found = EntitySelections(scenario), set[str]()
    for group in _groups(scenario):
        for element in _elements(scenario, group):
            if isinstance(element, EntityAction) and element.add_entity_action is not None:
                found.update(selections.members(element.entity_ref))
            elif isinstance(element, TeleportAction):
                found.update(_actors(scenario, selections, group))
    return frozenset(found)


def _moved(scenario: Scenario) -> frozenset[str]:
    """Return the entities of which an action requests a speed, or which one may move otherwise."""
    own = registry("actions")
    if any(command.type in own for command in scenario.custom_commands):
        return frozenset(scenario.entities)
    selections, found = EntitySelections(scenario), set[str]()
    for private in scenario.storyboard.init.actions.private:
        if any(map(_moves, private.private_action)):
            found.update(selections.members(private.entity_ref))
    for group in _groups(scenario):
        if any(isinstance(element, PrivateAction) and _moves(element) for element in _elements(scenario, group)):
            found.update(_actors(scenario, selections, group))
    return frozenset(found)


def _moves(action: PrivateAction) -> bool:
    """Whether an action requests a speed, overrides pedals, or assigns another controller. Routes have no speed."""
    longitudinal, control = action.longitudinal_action, action.controller_action
    if longitudinal is not None:
        speed = longitudinal.speed_action
        absolute = None if speed is None else speed.speed_action_target.absolute_target_speed
        return absolute is None or absolute.value != 0.0
    if control is not None:
        return control.override_controller_value_action is not None or control.assign_controller_action is not None
    return action.synchronize_action is not None


def _groups(scenario: Scenario) -> Iterator[ManeuverGroup]:
    for story in scenario.storyboard.story:
        for act in story.act:
            yield from act.maneuver_group


def _elements(scenario: Scenario, group: ManeuverGroup) -> Iterator[Element]:
    """Yield the elements of a maneuver group, and those of its maneuvers of catalogs."""
    for element in group.walk():
        yield element
        entry = scenario.entries.get(element) if isinstance(element, CatalogReference) else None
        if entry is not None:
            yield from entry.walk()


def _actors(scenario: Scenario, selections: EntitySelections, group: ManeuverGroup) -> Collection[str]:
    """Return the entities that may be actors of a group."""
    if group.actors.select_triggering_entities:
        return list(scenario.entities)
    return [name for ref in group.actors.entity_ref for name in selections.members(ref.entity_ref)]


def _diagnostic(scenario: Scenario, name: str, commands: Commands) -> Diagnostic:
    controller = [one for one in scenario.controllers[name] if is_agent_controller(one)][-1]
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
    controller = [one for one in scenario.controllers[name] if is_agent_controller(one)][-1]
    return next((one.line for one in property_entries(controller) if one.name == _PLANNER), None)
