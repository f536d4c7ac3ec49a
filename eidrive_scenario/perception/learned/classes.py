"""What the learned detectors tell apart, and what of it is an object on the road."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import CLASSES

OBJECT_CLASSES = ("car", "truck", "bus", "motorbike", "bicycle", "pedestrian")
LIGHT_STATES = ("red", "yellow", "green", "off")
LIGHT = "traffic light"
STOP_SIGN = "stop sign"
IMAGE_CLASSES = (*OBJECT_CLASSES, *(f"{LIGHT} {state}" for state in LIGHT_STATES), STOP_SIGN)
"""The classes of the shipped weights, in the order of the networks' outputs."""

_VEHICLES = ("car", "truck", "bus", "van")
_SAME_AS = {"van": "car", "person": "pedestrian", "motorcycle": "motorbike"}


def image_class(category: str) -> str:
    """The class under which an actor of this category is looked for: a van counts as a car."""
    return _SAME_AS.get(category, category)


def object_category(name: str) -> str | None:
    """One of eidrive_scenario.detections.CLASSES for a class of a network, None for what is no object on the road."""
    if name in CLASSES:
        return name
    known = _SAME_AS.get(name)
    return known if known in CLASSES else None


def light_state(name: str) -> str | None:
    """The state in the name of a traffic light's class; None for all other classes."""
    if name == LIGHT:
        return "unknown"
    return name.removeprefix(f"{LIGHT} ") if name.startswith(f"{LIGHT} ") else None


def suppression_groups(names: Sequence[str]) -> NDArray[np.int64]:
    """(C,) group of each class: of two boxes of one group on one place, only the better one counts.

    One lamp cannot be red and green, so the states of a light are a group; a vehicle is not a car and a truck.
    """
    groups: dict[str, int] = {}
    keys = [LIGHT if light_state(name) else "vehicle" if name in _VEHICLES else name for name in names]
    return np.array([groups.setdefault(key, len(groups)) for key in keys], dtype=np.int64)
