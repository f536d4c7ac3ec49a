"""Options of a run that change its scenario: entities with a driving stack, and the planner of all driven stations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from eidrive_scenario.driving.planner_settings import NO_PLANNER
from eidrive_scenario.driving.settings import NAME_PROPERTIES, agent_settings
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.files.yaml_text import YamlContent, flow_yaml, read_yaml_source
from eidrive_scenario.openscenario import Scenario, model
from eidrive_scenario.openscenario.conventions import MODULE, is_agent_controller, property_entries
from eidrive_scenario.run_options import YamlSource
from eidrive_scenario.storyboard.kinematics.trailers import declared_trailer
from eidrive_scenario.world.specs import actor_spec

DRIVE = "RunSettings.drive"
PLANNER = "RunSettings.planner"
_TOWED = (model.VehicleCategory.TRAILER, model.VehicleCategory.SEMITRAILER)
_OF_SPEED = ("target_speed", "follow_speed_limit")
_EXAMPLE = "{planner: route, detector: oracle}"


def drive_entities(
    scenario: Scenario, drive: Mapping[str, YamlSource | None]
) -> tuple[Scenario, tuple[Diagnostic, ...]]:
    """Return the scenario with a driving stack for these entities, and warnings of the controllers that it replaces.

    drive  properties of the stack by entity: YAML text or file; None for the defaults

    A stack without a property for its speed follows the speed limit of the lane until the storyboard requests a speed.
    Raise SettingError with all diagnostics: an entity that cannot be driven, a file that cannot be read.
    """
    if not drive:
        return scenario, ()
    diagnostics: list[Diagnostic] = []
    controllers = dict(scenario.controllers)
    for name, source in drive.items():
        diagnostics += _unsuitable(scenario, name)
        try:
            stack = _stack(scenario, name, source)
        except SettingError as error:
            diagnostics += error.diagnostics
            continue
        controllers[name] = (stack,)
    if diagnostics:
        raise SettingError(diagnostics)
    replaced = [(name, controller) for name in drive for controller in scenario.controllers[name]]
    warnings = tuple(
        Diagnostic.at(
            controller, f"controller {controller.name!r} of {name!r} is replaced by a driving stack ({DRIVE})"
        )
        for name, controller in replaced
    )
    return replace(scenario, controllers=controllers, driven=frozenset(drive)), warnings


def _unsuitable(scenario: Scenario, name: str) -> Iterator[Diagnostic]:
    """Yield the reason why an entity cannot be driven."""
    entity = scenario.entities.get(name)
    towed = {declared_trailer(other) for other in scenario.entities.values()} - {None}
    vehicles = [
        other
        for other, body in scenario.entities.items()
        if isinstance(body, model.Vehicle) and other not in towed and body.vehicle_category not in _TOWED
    ]
    hint = f"the scenario has the vehicles {', '.join(vehicles)}" if vehicles else "the scenario has no vehicle"
    if entity is None:
        hint = suggestion(name, vehicles) if vehicles else hint
        yield Diagnostic(f"the scenario has no entity {quoted(name)}", hint, DRIVE)
    elif name in scenario.external:
        yield Diagnostic(f"{name!r} is an object of the road network or of another tool", hint, DRIVE)
    elif not isinstance(entity, model.Vehicle):
        kind = "a pedestrian" if isinstance(entity, model.Pedestrian) else "a miscellaneous object"
        yield Diagnostic(f"{name!r} is {kind}, not a vehicle", hint, DRIVE)
    elif name not in vehicles:
        yield Diagnostic(f"{name!r} is a trailer, which is towed", hint, DRIVE)
    elif not actor_spec(name, entity).has_wheels:
        yield Diagnostic(f"{name!r} has no front axle to steer by", hint, DRIVE)
    else:
        for controller in filter(is_agent_controller, scenario.controllers.get(name, ())):
            what = f"{name!r} has a driving stack already ({controller.source}:{controller.line})"
            yield Diagnostic(what, "change the properties of its controller, or remove the option", DRIVE)


def _stack(scenario: Scenario, name: str, source: YamlSource | None) -> model.Controller:
    """Return an eidrive controller with the properties of a YAML mapping. Raise SettingError if it is not a mapping."""
    origin = f"{DRIVE} {name}"
    content = YamlContent({}, origin) if source is None else read_yaml_source(source, option=origin)
    if not isinstance(content.data, Mapping):
        message = f"a driving stack is a mapping of properties (got {quoted(content.data)})"
        raise SettingError(Diagnostic(message, f"write {_EXAMPLE}", content.source))
    if content.data.get("module", MODULE) != MODULE:
        message = f"property 'module' is {quoted(content.data['module'])}"
        hint = f"remove it, or write {MODULE}"
        raise SettingError(Diagnostic(message, hint, content.source, content.lines.get("module")))
    data: dict[Any, Any] = {"module": MODULE, **content.data}
    if not any(key in data for key in _OF_SPEED):
        data["follow_speed_limit"] = True
    entries = tuple(
        model.Property(
            name=str(key),
            value=value if key in NAME_PROPERTIES and isinstance(value, str) else flow_yaml(value, setting=str(key)),
            scope=scenario.scope,
            line=content.lines.get(str(key), 0),
            source=content.source,
        )
        for key, value in data.items()
        if value is not None or key not in NAME_PROPERTIES
    )
    line = 1 if content.lines else 0
    properties = model.Properties(property=entries, line=line, source=content.source)
    return model.Controller(name=MODULE, properties=properties, line=line, source=content.source)


def select_planner(scenario: Scenario, planner: str | None, *, only: str | None = None) -> Scenario:
    """Return the scenario with this planner for all driven stations, or `only` for one; unchanged for None.

    A parked station, whose planner is `none`, remains parked. The property `planner_settings` of the file applies to
    the planner of the file only. Raise SettingError if the planner does not exist or no station drives.
    """
    if planner is None:
        return scenario
    if planner not in registry("planners"):
        raise SettingError(registry("planners").unknown(planner, source=PLANNER))
    controllers = {
        name: assigned
        if only not in (None, name)
        else tuple(_with_planner(scenario, name, controller, planner) for controller in assigned)
        for name, assigned in scenario.controllers.items()
    }
    if controllers == dict(scenario.controllers) and not _has_driver(scenario):
        message = f"planner {quoted(planner)} has no effect: the scenario has no station that drives"
        raise SettingError(Diagnostic(message, f"remove the option, or give a vehicle a stack by {DRIVE}", PLANNER))
    return replace(scenario, controllers=controllers)


def _has_driver(scenario: Scenario) -> bool:
    return any(
        _planner_of(scenario, name, controller) is not None
        for name, assigned in scenario.controllers.items()
        for controller in assigned
    )


def _planner_of(scenario: Scenario, name: str, controller: model.Controller) -> str | None:
    """Return the planner of a controller; "" for the default, None for one that does not drive."""
    if not is_agent_controller(controller) or not actor_spec(name, scenario.entities[name]).has_wheels:
        return None
    try:
        planner = agent_settings(controller).planner
    except SettingError:  # The stack reports the errors of the properties
        return ""
    return None if planner == NO_PLANNER else planner or ""


def _with_planner(scenario: Scenario, name: str, controller: model.Controller, planner: str) -> model.Controller:
    """Return a controller with the planner if it drives; its other properties are kept."""
    before = _planner_of(scenario, name, controller)
    if before is None or before == planner:
        return controller
    replaced = ("planner", "planner_settings")
    kept = tuple(entry for entry in property_entries(controller) if entry.name not in replaced)
    selected = model.Property(name="planner", value=planner, scope=scenario.scope, line=controller.line, source=PLANNER)
    line, source = controller.line, controller.source
    return replace(controller, properties=model.Properties(property=(*kept, selected), line=line, source=source))
