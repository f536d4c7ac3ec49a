"""Stations of background traffic: a share of its vehicles perceives and sends messages."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.driving.planner_settings import NO_PLANNER
from eidrive_scenario.driving.settings import AgentSettings, parse_station_settings
from eidrive_scenario.driving.stack import StackContext
from eidrive_scenario.driving.station_declarations import (
    build_encoder,
    checked_detector,
    unknown_senders,
    with_options,
    with_senders,
)
from eidrive_scenario.errors import Diagnostic, ErrorCollector, ErrorSubject, SettingError, quoted
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.yaml_text import load_mapping
from eidrive_scenario.openscenario.scenario import EntitySelections
from eidrive_scenario.openscenario.values.parameters import Scope, parameter_hints, resolve_references
from eidrive_scenario.perception.detector import Detector

COMMAND = "eidrive.traffic_stations"


class _Share(Settings):
    share: Annotated[float, Field(ge=0.0, le=1.0)]


@dataclass(frozen=True)
class TrafficStations:
    """Stations of background traffic as a command declares them.

    share     of the vehicles that enter
    settings  of each station, which does not drive
    lines     line of each setting in `source`
    """

    share: float
    settings: AgentSettings
    source: str
    line: int | None
    lines: Mapping[str, int]

    def includes(self, vehicle: str, seed: int) -> bool:
        """Return whether a vehicle is a station. A vehicle that is one stays one if only the share is increased."""
        return float(generator(seed, "traffic station", vehicle).random()) < self.share

    def located(self, *settings: str) -> tuple[str, int | None]:
        """Return file and line of the first of these settings that is given; else those of the command."""
        return self.source, next((self.lines[name] for name in settings if name in self.lines), self.line)


def parse_traffic_stations(content: str, *, source: str, line: int | None, scope: Scope | None) -> TrafficStations:
    """Parse a command `eidrive.traffic_stations`. Raise SettingError with all diagnostics."""
    hint = "write {share: 0.3} and properties of the stations"
    data, lines = load_mapping(content, COMMAND, hint, source=source, line=line)
    origins = parameter_hints(data, scope)
    data = resolve_references(data, scope, source=source, line=line, lines=lines)
    given = {key: data.pop(key) for key in ("share",) if key in data}
    planner = data.setdefault("planner", NO_PLANNER)
    errors = ErrorCollector(SettingError)
    with errors:
        share = parse_settings(_Share, given, source=source, line=line, lines=lines, origins=origins).share
    with errors:
        settings = parse_station_settings(data, source=source, line=line, lines=lines, origins=origins)
    with errors:
        if planner != NO_PLANNER:
            message = f"planner {quoted(planner)} for vehicles that the traffic drives"
            raise SettingError(Diagnostic(message, "remove the setting", source, lines.get("planner", line)))
    errors.raise_if_any()
    return TrafficStations(share, settings, source, line, lines)


def build_traffic_stations(
    declared: TrafficStations, context: StackContext, selected: Mapping[str, str], known: Collection[str]
) -> tuple[TrafficStations, Detector]:
    """Return stations with the options of the run applied, and the detector of one of them.

    selected  as of `declared_settings`
    known     stations of the scenario

    Raise SettingError for unknown senders and extensions with invalid settings.
    """
    selections = EntitySelections(context.scenario)
    settings = with_senders(declared.settings, selections, known)
    diagnostics = unknown_senders(COMMAND, settings, selections, known, declared.located)
    if diagnostics:
        raise SettingError(diagnostics)
    settings = with_options(settings, selected, context.cooperate, drives=False)
    detector = checked_detector(
        settings,
        ErrorSubject("stations of traffic"),
        declared.located,
        selected,
        load_weights=context.load_weights,
        allow_torchscript=context.allow_torchscript,
    )
    if settings.asn1_files:
        build_encoder(settings, context.scenario, "car", declared.located)
    return replace(declared, settings=settings), detector
