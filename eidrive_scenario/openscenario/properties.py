"""Properties beyond the standard, by which objects and controllers are configured."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.controllers import Controller
from eidrive_scenario.openscenario.model.entities import MiscObject, Pedestrian
from eidrive_scenario.openscenario.model.properties import Property
from eidrive_scenario.openscenario.model.vehicles import Vehicle

MODULE = "eidrive"
"""Value of the property `module` of a controller of this project."""


def property_entries(holder: Controller | MiscObject | Pedestrian | Vehicle) -> tuple[Property, ...]:
    """Return the properties of an object or controller in the order of the file."""
    return () if holder.properties is None else holder.properties.property


def is_agent_controller(controller: Controller) -> bool:
    """Return True if a controller has the property `module=eidrive`."""
    return any(entry.name == "module" and entry.value == MODULE for entry in property_entries(controller))
