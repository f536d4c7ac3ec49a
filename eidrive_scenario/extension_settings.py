"""Settings of extensions: their types, settings of a selected extension, and settings that select one by `kind`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from eidrive_scenario.errors import Diagnostic, RegistryError, SettingError, suggestion
from eidrive_scenario.registry import registry, singular
from eidrive_scenario.settings import Settings, parse_settings, validate_nested

S = TypeVar("S", bound=Settings)


def settings_type_of(kind: str, name: str, extension: object, base: type[S]) -> type[S]:
    """Return the `settings_type` of an extension. Raise RegistryError if it is not derived from `base`.

    kind, name  registry and registered name of the extension
    """
    found = getattr(extension, "settings_type", None)
    if isinstance(found, type) and issubclass(found, base):
        return found
    described = registry(kind).describe(name)
    raise RegistryError(f"{described}: settings_type is {found!r} (expected a class derived from {base.__name__})")


def optional_settings_type(kind: str, name: str, extension: object) -> type[Settings] | None:
    """Return the `settings_type` of an extension, or None if it has no settings. Raise RegistryError as above."""
    if getattr(extension, "settings_type", None) is None:
        return None
    return settings_type_of(kind, name, extension, Settings)


def parse_own_settings(
    kind: str,
    name: str,
    extension: object,
    given: Mapping[str, Any],
    *,
    setting: str,
    source: str = "",
    line: int | None = None,
) -> Settings | None:
    """Return the settings of an extension from the property `setting`; None if the extension has no settings.

    Raise SettingError with this location if they are invalid, or are given to an extension without settings.
    """
    model = optional_settings_type(kind, name, extension)
    if model is not None:
        return parse_settings(model, given, source=source, line=line)
    if given:
        message = f"{singular(kind)} {name!r} has no settings"
        raise SettingError(Diagnostic(message, f"remove the property {setting!r}", source, line))
    return None


def validate_by_kind(
    kind: str,
    value: Mapping[str, Any],
    base: type[S],
    extension_base: type | None = None,
    *,
    also: tuple[str, ...] = (),
) -> S:
    """Return settings as an instance of the `settings_type` of the extension that their key `kind` names.

    kind  registry of the extensions, classes derived from `extension_base`;  also  further names that hints list

    Raise ValidationError if the name is unknown or the settings are invalid.
    """
    known, name = registry(kind), value.get("kind")
    if not (isinstance(name, str) and name in known):
        hint = suggestion(str(name), [*known, *also])
        error = PydanticCustomError("value_error", "{hint}", {"hint": hint})
        raise ValidationError.from_exception_data(
            base.__name__, [InitErrorDetails(type=error, loc=("kind",), input=name)]
        )
    return validate_nested(settings_type_of(kind, name, known.load(name, extension_base), base), value)
