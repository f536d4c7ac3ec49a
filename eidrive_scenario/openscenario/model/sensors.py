"""Sensors as entities: in an early schema of 1.2 only, not in its final one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.openscenario.model.declarations import ParameterDeclarations
from eidrive_scenario.openscenario.model.element import Element, attribute, element_type
from eidrive_scenario.openscenario.model.entity_enumerations import SensorCategory
from eidrive_scenario.openscenario.model.properties import Properties
from eidrive_scenario.openscenario.model.scalars import SensorName

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.model.positions import RelativeObjectPosition


@element_type
class Sensor(Element):
    """Sensor and its field of view [rad]."""

    sensor_category: SensorCategory
    name: str
    horizontal_fov: float = attribute(name="horizontalFOV", required=True)
    vertical_fov: float = attribute(name="verticalFOV", required=True)
    parameter_declarations: ParameterDeclarations | None = None
    properties: Properties


@element_type
class SensorAttachment(Element):
    """Mounting position of a sensor on the vehicle."""

    sensor_ref: SensorName
    mounting_position: RelativeObjectPosition


@element_type
class SensorAttachments(Element):
    """Sensors of a vehicle."""

    sensor_attachment: tuple[SensorAttachment, ...] = ()


@element_type
class SensorReference(Element):
    """Reference to a sensor by its name."""

    name: str


@element_type
class SensorReferenceSet(Element):
    """References to sensors by their names."""

    sensor_reference: tuple[SensorReference, ...]
