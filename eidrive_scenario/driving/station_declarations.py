"""Stations as a scenario declares them: settings, detectors, encoders, and the settings with all defaults."""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from eidrive_scenario.driving.agent_factory import build_detector, build_fusion, selected_extension
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planner_settings import DEFAULT_PLANNER, NO_PLANNER
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import SELECTED, AgentSettings, agent_settings
from eidrive_scenario.driving.stack import StackSettings
from eidrive_scenario.errors import Diagnostic, ErrorCollector, ErrorSubject, SettingError, suggestion
from eidrive_scenario.extensions.registry import distributions, registry
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.openscenario.model import Controller
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.sensing.sensor import sensor_class
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.world.specs import actor_spec

Located = Callable[..., tuple[str, int | None]]
"""Returns file and line of the first of several settings that is given; else those of the station."""


def declared_settings(
    scenario: Scenario, selected: Mapping[str, str] = MappingProxyType({}), cooperate: tuple[str, ...] | None = None
) -> dict[str, AgentSettings]:
    """Return the settings of every station, with options applied. Raise SettingError with all diagnostics.

    selected  detector and fusion method of options, by the property that each replaces
    """
    diagnostics = [
        registry(SELECTED[part]).unknown(name, source=f"RunSettings.{part}")
        for part, name in selected.items()
        if name not in registry(SELECTED[part])
    ]
    if diagnostics:
        raise SettingError(diagnostics)
    declared: dict[str, AgentSettings] = {}
    controllers: dict[str, Controller] = {}
    for name, assigned in scenario.controllers.items():
        for controller in filter(is_agent_controller, assigned):
            try:
                declared[name] = agent_settings(controller)
            except SettingError as error:
                diagnostics.extend(error.diagnostics)
            controllers[name] = controller
    selections = EntitySelections(scenario)
    for name, settings in declared.items():
        declared[name] = settings = with_senders(settings, selections, controllers)
        located = partial(property_location, controllers[name])
        diagnostics += unknown_senders(name, settings, selections, controllers, located)
        if settings.planner not in (None, NO_PLANNER) and not _has_wheels(scenario, name):
            message = f"{name!r} has no wheels for planner {settings.planner!r}"
            line = property_line(controllers[name], "planner")
            diagnostics.append(Diagnostic(message, "remove the property 'planner'", controllers[name].source, line))
    cooperate = _without_selections(cooperate, selections, controllers)
    for sender in cooperate or ():
        if sender not in controllers:
            what = "selection without stations" if sender in selections.declared else "no station"
            hint = _sender_hint(sender, selections, controllers)
            diagnostics.append(Diagnostic(f"{what} {sender!r}", hint, "RunSettings.cooperate"))
    if diagnostics:
        raise SettingError(diagnostics)
    return {
        name: with_options(settings, selected, cooperate, drives=_drives(scenario, name, settings))
        for name, settings in declared.items()
    }


def with_options(
    settings: AgentSettings, selected: Mapping[str, str], cooperate: tuple[str, ...] | None, *, drives: bool
) -> AgentSettings:
    """Return the settings of a station with the options of `declared_settings` applied."""
    update: dict[str, Any] = dict(selected)
    # Settings of the file apply to the detector and the fusion method of the file
    update |= {f"{part}_settings": {} for part, name in selected.items() if name != getattr(settings, part)}
    if cooperate is not None and (settings.restricts_senders or drives):
        update["cooperates_with"] = cooperate
    return settings.model_copy(update=update)


def possible_drivers(scenario: Scenario, settings: Mapping[str, AgentSettings]) -> list[str]:
    """Return the stations that drive while their controller is active."""
    return [name for name, station in settings.items() if _drives(scenario, name, station)]


def without_speed(settings: AgentSettings, *, limited: bool) -> bool:
    """Return whether a driving station keeps its initial speed until the storyboard requests another one.

    limited  whether there are roads, which have speed limits

    Planners that do not derive from RoutePlanner may choose a speed by themselves.
    """
    planner = registry("planners").load(settings.planner or DEFAULT_PLANNER)
    from_settings = settings.target_speed is not None or (settings.follow_speed_limit and limited)
    return issubclass(planner, RoutePlanner) and not from_settings


def _drives(scenario: Scenario, name: str, settings: AgentSettings) -> bool:
    return settings.planner != NO_PLANNER and _has_wheels(scenario, name)


def _has_wheels(scenario: Scenario, name: str) -> bool:
    return actor_spec(name, scenario.entities[name]).has_wheels


def declared_detectors(
    scenario: Scenario,
    settings: Mapping[str, AgentSettings],
    selected: Mapping[str, str],
    *,
    load_weights: bool = True,
    allow_torchscript: bool = False,
) -> dict[str, Detector]:
    """Build the detector of every station, and load its weights if `load_weights`, or else check that a run may.

    selected  detector and fusion method of options, by the property that each replaces

    Raise SettingError with all diagnostics of detectors, sensors, fusion methods and vehicle controllers.
    """
    errors = ErrorCollector(SettingError)
    detectors: dict[str, Detector] = {}
    for name, station in settings.items():
        located = partial(property_location, station_controller(scenario, name))
        with errors:
            detectors[name] = checked_detector(
                station,
                ErrorSubject(f"station {name!r}"),
                located,
                selected,
                load_weights=load_weights,
                allow_torchscript=allow_torchscript,
            )
    errors.raise_if_any()
    return detectors


def checked_detector(
    station: AgentSettings,
    subject: ErrorSubject,
    located: Located,
    selected: Mapping[str, str],
    *,
    load_weights: bool,
    allow_torchscript: bool,
) -> Detector:
    """Build the detector of a station as `declared_detectors`, and check its sensors and other extensions.

    subject  station that errors of its extensions name

    Raise SettingError with the location of the setting.
    """

    def origin(part: str) -> tuple[str, int | None]:
        if part in selected and not getattr(station, f"{part}_settings"):  # only the option determines it
            return f"RunSettings.{part}", None
        return located(f"{part}_settings", part)

    source, line = origin("detector")
    try:
        detector = subject.call(build_detector, station, source=source, line=line)
        weights = detector.load_weights if load_weights else detector.check_weights
        subject.call(weights, allow_torchscript=allow_torchscript)
        source, line = located("sensors")
        for sensor in station.rig_sensors(detector.needs, detector.default_sensors).values():
            sensor_class(sensor.kind).check_settings(sensor)
        source, line = origin("fusion")
        subject.call(build_fusion, station, detector, source=source, line=line)
        source, line = origin("vehicle_controller")
        selected_extension(station, "vehicle_controller", VehicleController, source=source, line=line)
    except SettingError as error:
        raise error.at(source, line) from error
    return detector


def declared_encoders(scenario: Scenario, settings: Mapping[str, AgentSettings]) -> dict[str, Asn1Encoder]:
    """Build the encoder of every station with ASN.1 modules. Raise SettingError with the location of the property."""
    encoders = {}
    for name, station in settings.items():
        if station.asn1_files:
            category = actor_spec(name, scenario.entities[name]).category
            located = partial(property_location, station_controller(scenario, name))
            encoders[name] = build_encoder(station, scenario, category, located)
    return encoders


def build_encoder(settings: AgentSettings, scenario: Scenario, category: str, located: Located) -> Asn1Encoder:
    """Build the encoder of a station of this category from ASN.1 modules, relative to the scenario."""
    folder = Path(scenario.path).parent if scenario.path is not None else Path()
    source, line = located("asn1_files")
    files = [folder / file for file in settings.asn1_files]
    return Asn1Encoder(files, settings.messages, station=category, source=source, line=line)


def station_controller(scenario: Scenario, name: str) -> Controller:
    """Return the controller of a station, the last one if it has several."""
    return list(filter(is_agent_controller, scenario.controllers[name]))[-1]


def property_line(controller: Controller, *properties: str) -> int:
    """Return the line of the first of these properties that a controller has; else that of the controller."""
    lines = {entry.name: entry.line for entry in property_entries(controller)}
    return next((lines[name] for name in properties if name in lines), controller.line)


def property_location(controller: Controller, *properties: str) -> tuple[str, int | None]:
    """Return the file and `property_line` of a controller."""
    return controller.source, property_line(controller, *properties)


def with_senders(settings: AgentSettings, selections: EntitySelections, stations: Container[str]) -> AgentSettings:
    """Return settings whose senders are stations, without selections of them."""
    senders = _without_selections(settings.cooperates_with, selections, stations)
    unchanged = senders == settings.cooperates_with
    return settings if unchanged else settings.model_copy(update={"cooperates_with": senders})


def _without_selections(
    senders: tuple[str, ...] | None, selections: EntitySelections, stations: Container[str]
) -> tuple[str, ...] | None:
    """Return the senders with each selection replaced by the stations among its members, if there are any."""
    if senders is None:
        return None
    expanded: dict[str, None] = {}
    for sender in senders:
        members = [name for name in selections.members(sender) if name in stations]
        expanded.update(dict.fromkeys(members or [sender]))
    return tuple(expanded)


def _sender_hint(sender: str, selections: EntitySelections, stations: Iterable[str]) -> str:
    if sender in selections.declared:
        return "give one of its members a driving stack"
    return suggestion(sender, [*stations, *selections.declared])


def unknown_senders(
    name: str,
    settings: AgentSettings,
    selections: EntitySelections,
    stations: Collection[str],
    located: Located,
) -> list[Diagnostic]:
    """Return an error for each sender of the settings that is none of these stations.

    name  of the receiving station, or of the command that declares it
    """
    return [
        Diagnostic(
            f"{name!r} cooperates with {sender!r}, which "
            + ("is a selection without stations" if sender in selections.declared else "is no station"),
            _sender_hint(sender, selections, [other for other in stations if other != name]),
            *located("cooperates_with"),
        )
        for sender in settings.cooperates_with or ()
        if sender not in stations
    ]


_WITH_SETTINGS = {"detector": Detector, "fusion": FusionMethod, "vehicle_controller": VehicleController}
"""Properties that name extensions with settings in a property `NAME_settings`, and base classes of the extensions."""


def resolved_stations(
    settings: Mapping[str, AgentSettings],
    traffic: Sequence[tuple[float, AgentSettings]],
    channel: str,
    profile: ChannelProfile | None,
) -> StackSettings:
    """Return the settings of stations and channel with the defaults of all extensions.

    traffic  share and settings of the stations of background traffic, of each command
    """
    used = {("channels", profile.model)} if profile is not None else set()
    for station in (*settings.values(), *(station for _, station in traffic)):
        used |= {
            ("detectors", station.detector),
            ("fusion", station.fusion),
            ("planners", station.planner or ""),
            ("vehicle_controllers", station.vehicle_controller),
            ("trackers", station.tracker.kind if station.tracker is not None else ""),
        }
    return StackSettings(
        channel=channel,
        channel_profile=None if profile is None else profile.model_dump(mode="json"),
        stations={name: _resolved(station) for name, station in sorted(settings.items())},
        traffic_stations=[{"share": share, **_resolved(station)} for share, station in traffic],
        extensions=distributions(used),
    )


def _resolved(station: AgentSettings) -> dict[str, Any]:
    """Return the settings of a station with the defaults of its extensions."""
    written = station.model_dump(mode="json")
    for part, base in _WITH_SETTINGS.items():
        for own in selected_extension(station, part, base)[1]:
            written[f"{part}_settings"] = own.model_dump(mode="json")
    return written
