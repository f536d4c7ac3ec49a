"""Bodies of recorded road users: the entry of the library's catalogs that is nearest in size, with the recorded box."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cache

from lxml import etree

from eidrive_scenario.extensions.library import CATALOGS, SCENARIO_SUFFIX, library_path

SAME_SIZE = 0.01
"""Difference of sizes up to which a body is that of a catalog [m]. Only then it may be an emergency vehicle."""
_CATEGORY = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}


@dataclass(frozen=True)
class Body:
    """Vehicle or Pedestrian element with a recorded box, and the center of the box relative to the reference point."""

    element: etree._Element
    center: tuple[float, float, float]


@cache
def _entries() -> tuple[tuple[etree._Element, tuple[float, float, float]], ...]:
    """Return the vehicles and pedestrians of the library with their sizes [m]."""
    bodies = []
    for name in ("vehicles", "pedestrians"):
        root = etree.parse(library_path() / CATALOGS / f"{name}{SCENARIO_SUFFIX}").getroot()
        for element in root.iter("Vehicle", "Pedestrian"):
            box = element.find("BoundingBox/Dimensions")
            assert box is not None
            length, width, height = (float(box.get(key, "0")) for key in ("length", "width", "height"))
            bodies.append((element, (length, width, height)))
    return tuple(bodies)


def body_of(category: str, size: tuple[float, float, float]) -> Body:
    """Return the body of a road user of a category ("" for any) with this length, width and height [m].

    Axles and center of the nearest entry are scaled with the length.
    """

    def difference(entry: tuple[etree._Element, tuple[float, float, float]]) -> float:
        return sum(abs(own - given) for own, given in zip(entry[1], size, strict=True))

    candidates = [entry for entry in _entries() if category in ("", entry[0].get(_CATEGORY[str(entry[0].tag)]))]
    candidates = [
        entry for entry in candidates or _entries() if not entry[0].get("role") or difference(entry) < SAME_SIZE
    ]
    entry, (length, *_) = min(candidates, key=difference)
    element = copy.deepcopy(entry)
    element.tail = None
    scale = size[0] / length
    center, dimensions = element.find("BoundingBox/Center"), element.find("BoundingBox/Dimensions")
    assert center is not None
    assert dimensions is not None
    ahead = float(center.get("x", "0")) * scale
    for key, value in zip(("x", "y", "z"), (ahead, 0.0, size[2] / 2.0), strict=True):
        center.set(key, repr(value))
    for key, value in zip(("length", "width", "height"), size, strict=True):
        dimensions.set(key, repr(value))
    for axle in element.iter("FrontAxle", "RearAxle"):
        axle.set("positionX", repr(float(axle.get("positionX", "0")) * scale))
    return Body(element, (ahead, 0.0, size[2] / 2.0))
