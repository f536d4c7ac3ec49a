"""The box around an object."""

from __future__ import annotations

from dataclasses import dataclass

from eidrive_scenario.openscenario.model.content import ALL
from eidrive_scenario.openscenario.model.element import Element


@dataclass(frozen=True, kw_only=True)
class Center(Element):
    """Position of the middle of the box in the frame of the object [m]."""

    x: float
    y: float
    z: float


@dataclass(frozen=True, kw_only=True)
class Dimensions(Element):
    """Extents of the box [m]."""

    height: float
    length: float
    width: float


@dataclass(frozen=True, kw_only=True)
class BoundingBox(Element, content=ALL):
    """The box around an object, axes along its frame."""

    center: Center
    dimensions: Dimensions
