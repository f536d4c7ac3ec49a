"""Driving stacks that the settings of a run give to entities of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from eidrive_scenario.driving.settings import NAME_PROPERTIES
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.files.yaml_text import YamlContent, flow_yaml, read_yaml_source
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import MODULE, is_agent_controller
from eidrive_scenario.openscenario.model import (
    Controller,
    Pedestrian,
    Properties,
    Property,
    Vehicle,
    VehicleCategory,
)
from eidrive_scenario.simulation.added_settings import YamlSource
from eidrive_scenario.storyboard.kinematics.trailers import declared_trailer
from eidrive_scenario.world.specs import actor_spec

OPTION = "--drive"
_TOWED = (VehicleCategory.TRAILER, VehicleCategory.SEMITRAILER)
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
        found = list(_unsuitable(scenario, name))
        diagnostics += found
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
        Diagnostic(
            f"controller {controller.name!r} of {name!r} is replaced by a driving stack ({OPTION})",
            "",
            controller.source,
            controller.line,
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
        if isinstance(body, Vehicle) and other not in towed and body.vehicle_category not in _TOWED
    ]
    hint = f"the scenario has the vehicles {', '.join(vehicles)}" if vehicles else "the scenario has no vehicle"
    if entity is None:
        hint = suggestion(name, vehicles) if vehicles else hint
        yield Diagnostic(f"the scenario has no entity {quoted(name)}", hint, OPTION)
    elif name in scenario.external:
        yield Diagnostic(f"{name!r} is an object of the road network or of another tool", hint, OPTION)
    elif not isinstance(entity, Vehicle):
        kind = "a pedestrian" if isinstance(entity, Pedestrian) else "a miscellaneous object"
        yield Diagnostic(f"{name!r} is {kind}, not a vehicle", hint, OPTION)
    elif name not in vehicles:
        yield Diagnostic(f"{name!r} is a trailer, which is towed", hint, OPTION)
    elif not actor_spec(name, entity).has_wheels:
        yield Diagnostic(f"{name!r} has no front axle to steer by", hint, OPTION)
    else:
        for controller in filter(is_agent_controller, scenario.controllers.get(name, ())):
            what = f"{name!r} has a driving stack already ({controller.source}:{controller.line})"
            yield Diagnostic(what, "change the properties of its controller, or remove the option", OPTION)


def _stack(scenario: Scenario, name: str, source: YamlSource | None) -> Controller:
    """Return an eidrive controller with the properties of a YAML mapping. Raise SettingError if it is not a mapping."""
    origin = f"{OPTION} {name}"
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
        Property(
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
    properties = Properties(property=entries, line=line, source=content.source)
    return Controller(name=MODULE, properties=properties, line=line, source=content.source)
