"""Numbers among the properties of a controller."""

from __future__ import annotations

import math
from typing import TypeVar

from eidrive_scenario.api.actions import model
from eidrive_scenario.api.common import Diagnostic, ScenarioError

Usual = TypeVar("Usual", float, float | None)


def number(controller: model.Controller, name: str, usual: Usual, *, least: float = -math.inf) -> float | Usual:
    """A property as a finite number of at least `least`; `usual` where the controller does not have it."""
    properties = controller.properties.property if controller.properties is not None else ()
    entry = next((entry for entry in reversed(properties) if entry.name == name), None)
    if entry is None:
        return usual
    try:
        value = float(entry.value)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and value >= least:
        return value
    hint = "give it a number" if least == -math.inf else f"give it a number of at least {least:g}"
    message = f"the controller {controller.name!r} has the property {name} = {entry.value!r}"
    raise ScenarioError(Diagnostic(message, hint, entry.source, entry.line))
