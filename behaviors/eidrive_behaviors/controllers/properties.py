"""Numeric properties of controllers."""

from __future__ import annotations

import math
from typing import TypeVar

from eidrive_scenario.api.actions import model
from eidrive_scenario.api.common import Diagnostic, ScenarioError

Default = TypeVar("Default", float, float | None)


def number(controller: model.Controller, name: str, default: Default, *, least: float = -math.inf) -> float | Default:
    """Return a property as a finite number of at least `least`; `default` if the controller does not have it."""
    properties = controller.properties.property if controller.properties is not None else ()
    entry = next((entry for entry in reversed(properties) if entry.name == name), None)
    if entry is None:
        return default
    try:
        value = float(entry.value)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and value >= least:
        return value
    expected = "a finite number" if least == -math.inf else f"a number of at least {least:g}"
    message = f"controller {controller.name!r}: invalid property {name} (got {entry.value!r}; expected {expected})"
    raise ScenarioError(Diagnostic(message, "", entry.source, entry.line))
