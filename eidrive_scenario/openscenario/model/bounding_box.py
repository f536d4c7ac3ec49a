"""Bounding box of an object."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import ALL
from eidrive_scenario.openscenario.model.element import Element


@dataclass(frozen=True, kw_only=True)
class Center(Element):
    """Center of the box in the frame of the object [m]."""

    x: float
    y: float
    z: float


@dataclass(frozen=True, kw_only=True)
class Dimensions(Element):
    """Dimensions of the box [m]."""

    height: float
    length: float
    width: float


@dataclass(frozen=True, kw_only=True)
class BoundingBox(Element, content=ALL):
    """Bounding box, parallel to the axes of the object frame."""

    center: Center
    dimensions: Dimensions
