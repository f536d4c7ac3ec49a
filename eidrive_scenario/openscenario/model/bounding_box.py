"""Bounding box of an object."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.content import ALL
from eidrive_scenario.openscenario.model.element import Element, element_type


@element_type
class Center(Element):
    """Center of the box in the frame of the object [m]."""

    x: float
    y: float
    z: float


@element_type
class Dimensions(Element):
    """Dimensions of the box [m]."""

    height: float
    length: float
    width: float


@element_type
class BoundingBox(Element, content=ALL):
    """Bounding box, parallel to the axes of the object frame."""

    center: Center
    dimensions: Dimensions
