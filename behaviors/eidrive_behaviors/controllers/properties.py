"""Numbers, truth values and choices among the properties of controllers."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TypeVar

from eidrive_scenario.api.actions import model, property_entries
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion

Default = TypeVar("Default", float, float | None)

_FLAGS: Mapping[str, bool] = {"true": True, "1": True, "false": False, "0": False}
"""Truth values of the type boolean of the schema, without case."""


def number(controller: model.Controller, name: str, default: Default, *, least: float = -math.inf) -> float | Default:
    """Return a property as a finite number of at least `least`; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    entry = _entry(controller, name)
    if entry is None:
        return default
    try:
        value = float(entry.value)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and value >= least:
        return value
    expected = "a finite number" if least == -math.inf else f"a number of at least {least:g}"
    raise _invalid(controller, entry, f"expected {expected}")


def flag(controller: model.Controller, name: str, default: bool) -> bool:
    """Return a property as a truth value; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    entry = _entry(controller, name)
    if entry is None:
        return default
    value = _FLAGS.get(entry.value.strip().lower())
    if value is None:
        raise _invalid(controller, entry, "expected true or false")
    return value


def choice(controller: model.Controller, name: str, known: Collection[str], default: str) -> str:
    """Return a property that is one of the known texts; `default` if the controller does not have it.

    Raise ScenarioError for another text.
    """
    entry = _entry(controller, name)
    if entry is None:
        return default
    if entry.value not in known:
        raise _invalid(controller, entry, suggestion(entry.value, known))
    return entry.value


def _entry(controller: model.Controller, name: str) -> model.Property | None:
    """Return the last property of this name; None without one."""
    return next((entry for entry in reversed(property_entries(controller)) if entry.name == name), None)


def _invalid(controller: model.Controller, entry: model.Property, expected: str) -> ScenarioError:
    message = f"controller {controller.name!r}: invalid property {entry.name} (got {entry.value!r}; {expected})"
    return ScenarioError(Diagnostic(message, "", entry.source, entry.line))
