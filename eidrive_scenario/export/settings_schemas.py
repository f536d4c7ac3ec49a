"""JSON schemas of YAML files, for completion and checks in editors: stacks, channels, criteria and weather.

They are generated from the settings models of the installed extensions and of those of the project. Numbers, truth
values, lists and words of a choice may also be references to parameters, `$NAME` or `${expression}`. Rules about
several settings are left to the parsers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from eidrive_scenario.driving.planner_settings import DEFAULT_PLANNER, NO_PLANNER
from eidrive_scenario.driving.settings import SELECTED, AgentSettings
from eidrive_scenario.errors import RegistryError
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.perception.tracking.method import NO_TRACKER
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.world.weather import Weather

Schema: TypeAlias = dict[str, Any]
Warn: TypeAlias = Callable[[str], None]

DIALECT = "http://json-schema.org/draft-07/schema#"
"""Dialect that the language servers of editors read."""
_DEFINITIONS = "$defs"
_REFERENCE = {"type": "string", "pattern": r"\$"}
_FREE: Schema = {"type": "object"}
"""Settings of an extension that does not load."""
_EMPTY: Schema = {"type": "object", "maxProperties": 0}
"""Settings of an extension without any."""


class _Models:
    """Schemas of the settings of extensions, with definitions whose names are unique.

    schemas      by group and name of the extension; they may be references
    definitions  content of the references
    """

    def __init__(self, groups: Iterable[str], warn: Warn, *common: type[BaseModel]) -> None:
        types: dict[tuple[str, str], type[BaseModel] | None] = {}
        self.schemas: dict[str, dict[str, Schema]] = {}
        for group in groups:
            names = registry(group)
            self.schemas[group] = dict.fromkeys(names, _FREE)
            for name in names:
                try:
                    types[group, name] = getattr(names.load(name), "settings_type", None)
                except RegistryError as error:
                    warn(f"the schema accepts any settings: {error}")
        models = dict.fromkeys([*common, *(model for model in types.values() if model is not None)])
        references, whole = models_json_schema([(model, "validation") for model in models])
        self.definitions: Schema = whole.get(_DEFINITIONS, {})
        for (group, name), model in types.items():
            self.schemas[group][name] = _EMPTY if model is None else dict(references[model, "validation"])
        self.common = [self._content(dict(references[model, "validation"])) for model in common]

    def definition(self, group: str, name: str) -> Schema:
        """Return the schema of the settings of an extension, which is no reference."""
        return self._content(self.schemas[group][name])

    def _content(self, schema: Schema) -> Schema:
        return self.definitions[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


def _with_kind(definition: Schema, name: str, *, required: bool) -> Schema:
    """Return the settings of an extension that their key `kind` names."""
    properties = {**definition.get("properties", {}), "kind": {"const": name}}
    others = [key for key in definition.get("required", ()) if key != "kind"]
    return {**definition, "properties": properties, "required": [*others, *(["kind"] if required else [])]}


def _cases(key: str, default: str, schemas: Mapping[str, Schema]) -> list[Schema]:
    """Return schemas under the condition that the property `key` has their name; an omitted one has the default."""
    return [
        {
            "if": {"properties": {key: {"const": name}}} | ({} if name == default else {"required": [key]}),
            "then": schema,
        }
        for name, schema in schemas.items()
    ]


def _stack(warn: Warn) -> Schema:
    """Return the schema of the properties of a driving stack."""
    models = _Models((*SELECTED.values(), "trackers", "sensors"), warn, AgentSettings)
    (schema,) = models.common
    properties = dict(schema["properties"])
    conditions: list[Schema] = []
    for part, group in SELECTED.items():
        given = properties[part].get("default")
        settings = models.schemas[group]
        names = [*settings]
        if part == "planner":  # properties of the stack may be the settings that it requires
            own = {name: models.definition(group, name) for name in names}
            settings = {name: {key: own[name][key] for key in own[name] if key != "required"} for name in names}
            names.append(NO_PLANNER)
        properties[part] = {"enum": names, "type": "string"}
        properties[f"{part}_settings"] = _FREE
        schemas = {name: {"properties": {f"{part}_settings": schema}} for name, schema in settings.items()}
        conditions += _cases(part, DEFAULT_PLANNER if given is None else given, schemas)
    for name in models.schemas["planners"]:
        for key, setting in models.definition("planners", name).get("properties", {}).items():
            alternatives = properties.setdefault(key, {"anyOf": []}).get("anyOf", [])
            if key not in AgentSettings.model_fields and setting not in alternatives:
                alternatives.append(setting)
    trackers = list(models.schemas["trackers"])
    properties["tracker"] = {
        "anyOf": [
            {"enum": [*dict.fromkeys([*trackers, NO_TRACKER])], "type": "string"},
            {"type": "null"},
            *(_with_kind(models.definition("trackers", name), name, required=True) for name in trackers),
            _with_kind(models.definition("trackers", trackers[0]), NO_TRACKER, required=False),
        ]
    }
    sensors = {name: models.definition("sensors", name) for name in models.schemas["sensors"]}
    properties["sensors"] = {
        "anyOf": [
            {"type": "string"},
            {"type": "null"},
            {"type": "array", "items": {"enum": list(sensors), "type": "string"}},
            {
                "type": "object",
                "properties": {
                    name: {"anyOf": [_with_kind(settings, name, required=False), {"type": "null"}]}
                    for name, settings in sensors.items()
                },
                "additionalProperties": {
                    "anyOf": [_with_kind(settings, name, required=True) for name, settings in sensors.items()]
                },
            },
        ]
    }
    return {**schema, "properties": properties, "allOf": conditions, _DEFINITIONS: models.definitions}


def _channel(warn: Warn) -> Schema:
    """Return the schema of a channel profile."""
    models = _Models(["channels"], warn, ChannelProfile)
    default = ChannelProfile.model_fields["model"].default
    schemas = models.schemas["channels"]
    return {
        "type": "object",
        "properties": {**models.common[0]["properties"], "model": {"enum": list(schemas), "type": "string"}},
        "allOf": _cases("model", default, schemas),
        _DEFINITIONS: models.definitions,
    }


def _criteria(warn: Warn) -> Schema:
    """Return the schema of criteria: a mapping of their names to their settings, or a list of such mappings."""
    models = _Models(["criteria"], warn)
    properties: Schema = {}
    for name, settings in models.schemas["criteria"].items():
        is_complete = not models.definition("criteria", name).get("required")
        properties[name] = {"anyOf": [settings, {"type": "null"}]} if is_complete else settings
    mapping = {"type": "object", "properties": properties, "additionalProperties": False, "minProperties": 1}
    several = {"type": "array", "items": {"$ref": f"#/{_DEFINITIONS}/criteria"}, "minItems": 1}
    definitions = {**models.definitions, "criteria": mapping}
    return {"anyOf": [{"$ref": f"#/{_DEFINITIONS}/criteria"}, several], _DEFINITIONS: definitions}


def _weather(warn: Warn) -> Schema:
    return Weather.model_json_schema()


SCHEMAS: Mapping[str, Callable[[Warn], Schema]] = {
    "stack": _stack,
    "channel": _channel,
    "criteria": _criteria,
    "weather": _weather,
}
"""Functions that generate the schemas, by the kind of file."""


def settings_schema(kind: str, warn: Warn = lambda text: None) -> Schema:
    """Return the JSON schema of files of a kind, one of SCHEMAS.

    warn  function that gets a line for each extension that does not load
    """
    schema = _adapted(SCHEMAS[kind](warn))
    return {"$schema": DIALECT, "title": f"eidrive {kind}", **{key: schema[key] for key in schema if key != "title"}}


_REPLACEABLE = {"number", "integer", "boolean", "array"}
"""Types of values that a reference to a parameter may replace."""


def _adapted(schema: Any) -> Any:
    """Return a schema in the dialect, without titles, and with references to parameters."""
    if isinstance(schema, list):
        return [_adapted(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    adapted: Schema = {}
    for key, value in schema.items():
        if key in ("properties", _DEFINITIONS):
            adapted[key] = {name: _adapted(part) for name, part in value.items()}
        elif key in ("default", "const", "enum", "required", "pattern", "discriminator"):
            adapted[key] = value
        elif key == "prefixItems":
            adapted["items"] = _adapted(value)
        elif key != "title":
            adapted[key] = _adapted(value)
    adapted.pop("discriminator", None)
    if adapted.get("type") in _REPLACEABLE and "const" not in adapted:
        return {**adapted, "type": [adapted["type"], "string"], "pattern": _REFERENCE["pattern"]}
    if "enum" in adapted:
        others = {key: adapted.pop(key) for key in ("default", "description") if key in adapted}
        return {"anyOf": [adapted, dict(_REFERENCE)], **others}
    return adapted
