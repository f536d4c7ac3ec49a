"""Settings of planners, in the properties of a controller."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

from pydantic import Field, ValidationError

from eidrive_scenario.errors import Diagnostic, RegistryError, SettingError, quoted
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import Settings, parse_settings, settings_type_of

NO_PLANNER = "none"
"""Planner of a station that does not drive: a parked vehicle, which holds its brake."""

DEFAULT_PLANNER = "behavior"
"""Planner of a vehicle whose controller names none."""

REACTION = 0.5
"""Time from the sight of an obstacle or of hidden traffic to braking [s]."""

Polygon = tuple[tuple[float, float], ...]


class PlannerSettings(Settings):
    """Settings of every planner; a planner derives from this class to add its own.

    min_existence  existence probability (score of an object without one) from which on the planner reacts to an object;
                   0.5 selects the likelier of the two hypotheses, as in trackers and fusion
    """

    area_setting: ClassVar[str | None] = None
    """Name of the setting that holds areas (`tuple[Polygon, ...]`) in which the planner expects other road users. These
    are drawn on pages and compared with the roads."""

    min_existence: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5

    @property
    def areas(self) -> tuple[Polygon, ...]:
        """Areas in which the planner expects other road users, in the world frame [m]."""
        return () if self.area_setting is None else getattr(self, self.area_setting) or ()


def planner_settings_type(name: str | None) -> type[PlannerSettings]:
    """Return the settings type of a planner; that of the default planner for None.

    Raise RegistryError if the planner does not load, or if its `settings_type` does not derive from PlannerSettings.
    """
    if name == NO_PLANNER:
        return PlannerSettings
    name = name or DEFAULT_PLANNER
    planner = registry("planners").load(name)
    if getattr(planner, "settings_type", None) is None:
        return PlannerSettings
    return settings_type_of("planners", name, planner, PlannerSettings)


def split_planner_settings(
    data: Mapping[str, Any],
    station_settings: Collection[str],
    *,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    origins: Mapping[str, str],
    diagnostics: list[Diagnostic],
) -> tuple[dict[str, Any], PlannerSettings]:
    """Return the properties of the station without those of its planner, and the settings of the planner.

    A setting of the planner is a property of its name, or an entry of the property `planner_settings`. Properties of
    planners that are not selected are checked and ignored, so that one file can be run with several planners.

    data              properties of the controller
    station_settings  names of the settings of all stations, which are none of the planner
    lines             line of each property
    origins           that of `parse_settings`
    diagnostics       list that receives all errors
    """
    rest = {key: value for key, value in data.items() if key != "planner_settings"}
    nested = data.get("planner_settings", {})
    if not isinstance(nested, Mapping):
        message = f"setting 'planner_settings' is {quoted(nested)}"
        hint = "a mapping is expected: {key: value, …}"
        diagnostics.append(Diagnostic(message, hint, source, lines.get("planner_settings", line)))
        nested = {}
    name = data.get("planner")
    is_known = isinstance(name, str) and (name == NO_PLANNER or name in registry("planners"))
    model = planner_settings_type(name if is_known else None)
    own = {key: rest.pop(key) for key in list(rest) if key not in station_settings and key in model.model_fields}
    for key in [key for key in own if key in nested]:
        message = f"setting {key!r} of the planner is given twice"
        diagnostics.append(Diagnostic(message, "remove it from 'planner_settings'", source, lines.get(key)))
    for key in [key for key in rest if key not in station_settings]:
        other = next((model for model in _installed() if key in model.model_fields), None)
        if other is not None:
            _parse(
                other, {key: rest.pop(key)}, source, lines.get(key, line), lines, origins, diagnostics, incomplete=True
            )
    planner_line = lines.get("planner_settings", lines.get("planner", line))
    nested_origins = {path.removeprefix("planner_settings."): text for path, text in origins.items()}
    paths = {str(key): f"planner_settings.{key}" for key in nested}
    settings = _parse(model, {**own, **nested}, source, planner_line, lines, nested_origins, diagnostics, paths)
    return rest, settings or PlannerSettings()


def _parse(
    model: type[PlannerSettings],
    given: Mapping[str, Any],
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    origins: Mapping[str, str],
    diagnostics: list[Diagnostic],
    paths: Mapping[str, str] = MappingProxyType({}),
    *,
    incomplete: bool = False,
) -> PlannerSettings | None:
    """Return the settings, or None after their errors are added to `diagnostics`.

    A missing setting is no error if the settings are incomplete, or if its property is invalid.
    """
    try:
        return parse_settings(model, given, source=source, line=line, lines=lines, origins=origins, paths=paths)
    except SettingError as error:
        cause = error.__cause__
        if not isinstance(cause, ValidationError):
            diagnostics += error.diagnostics
            return None
        for diagnostic, details in zip(error.diagnostics, cause.errors(include_url=False), strict=False):
            if details["type"] != "missing" or not (incomplete or details["loc"][0] in lines):
                diagnostics.append(diagnostic)
        return None


def _installed() -> Iterator[type[PlannerSettings]]:
    for name in registry("planners"):
        try:
            yield planner_settings_type(name)
        except RegistryError:  # A planner that is not selected may be broken
            continue
