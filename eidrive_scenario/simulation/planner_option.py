"""Planner that the settings of a run give to all driven stations of a scenario."""

from __future__ import annotations

from dataclasses import replace

from eidrive_scenario.driving.planner_settings import NO_PLANNER
from eidrive_scenario.driving.settings import agent_settings
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.model import Controller, Properties, Property
from eidrive_scenario.registry import registry
from eidrive_scenario.world.specs import actor_spec

OPTION = "--planner"


def select_planner(scenario: Scenario, planner: str | None, *, only: str | None = None) -> Scenario:
    """Return the scenario with this planner for all driven stations, or `only` for one; unchanged for None.

    A parked station, whose planner is `none`, remains parked. The property `planner_settings` of the file applies to
    the planner of the file only. Raise SettingError if the planner does not exist or no station drives.
    """
    if planner is None:
        return scenario
    if planner not in registry("planners"):
        raise SettingError(registry("planners").unknown(planner, source=OPTION))
    controllers = {
        name: assigned
        if only not in (None, name)
        else tuple(_with_planner(scenario, name, controller, planner) for controller in assigned)
        for name, assigned in scenario.controllers.items()
    }
    if controllers == dict(scenario.controllers) and not _has_driver(scenario):
        message = f"planner {quoted(planner)} has no effect: the scenario has no station that drives"
        raise SettingError(Diagnostic(message, "remove the option, or give a vehicle a stack by --drive", OPTION))
    return replace(scenario, controllers=controllers)


def _has_driver(scenario: Scenario) -> bool:
    return any(
        _planner_of(scenario, name, controller) is not None
        for name, assigned in scenario.controllers.items()
        for controller in assigned
    )


def _planner_of(scenario: Scenario, name: str, controller: Controller) -> str | None:
    """Return the planner of a controller; "" for the default, None for one that does not drive."""
    if not is_agent_controller(controller) or not actor_spec(name, scenario.entities[name]).has_wheels:
        return None
    try:
        planner = agent_settings(controller).planner
    except SettingError:  # The stack reports the errors of the properties
        return ""
    return None if planner == NO_PLANNER else planner or ""


def _with_planner(scenario: Scenario, name: str, controller: Controller, planner: str) -> Controller:
    """Return a controller with the planner if it drives; its other properties are kept."""
    before = _planner_of(scenario, name, controller)
    if before is None or before == planner:
        return controller
    replaced = ("planner", "planner_settings")
    kept = tuple(entry for entry in property_entries(controller) if entry.name not in replaced)
    selected = Property(name="planner", value=planner, scope=scenario.scope, line=controller.line, source=OPTION)
    line, source = controller.line, controller.source
    return replace(controller, properties=Properties(property=(*kept, selected), line=line, source=source))
