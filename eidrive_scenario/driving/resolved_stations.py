"""Resolved settings of stations, and the third-party extensions that they use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.stack import StackSettings
from eidrive_scenario.extension_settings import optional_settings_type
from eidrive_scenario.registry import distributions, registry
from eidrive_scenario.v2x.profile import ChannelProfile

_WITH_SETTINGS = (
    ("detectors", "detector"),
    ("fusion", "fusion"),
    ("vehicle_controllers", "vehicle_controller"),
)
"""Registries and properties of the extensions whose settings are in a property `NAME_settings`."""


def resolved_stations(
    settings: Mapping[str, AgentSettings], channel: str, profile: ChannelProfile | None
) -> StackSettings:
    """Return the settings of stations and channel with the defaults of all extensions."""
    used = {("channels", profile.model)} if profile is not None else set()
    for station in settings.values():
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
        extensions=distributions(used),
    )


def _resolved(settings: AgentSettings) -> dict[str, Any]:
    found = settings.model_dump(mode="json")
    for kind, name in _WITH_SETTINGS:
        model = optional_settings_type(kind, found[name], registry(kind).load(found[name]))
        if model is not None:
            found[f"{name}_settings"] = model.model_validate(found[f"{name}_settings"]).model_dump(mode="json")
    return found
