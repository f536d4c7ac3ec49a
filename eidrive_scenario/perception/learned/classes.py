"""Classes of the learned detectors, and their mapping to categories of road users."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import CLASSES
from eidrive_scenario.roads.model.signal_states import OFF, lamps

OBJECT_CLASSES = ("car", "truck", "bus", "motorbike", "bicycle", "pedestrian")
LIGHT_STATES = ("red", "yellow", "green", "off")
LIGHT = "traffic light"
STOP_SIGN = "stop sign"
IMAGE_CLASSES = (*OBJECT_CLASSES, *(f"{LIGHT} {state}" for state in LIGHT_STATES), STOP_SIGN)
"""The classes of the shipped weights, in the order of the networks' outputs."""

VEHICLES = ("car", "truck", "bus")
"""Those of vehicles with four or more wheels; a van is a car."""

VERY_LIKE = 0.85
"""Similarity (ratio of Ratcliff and Obershelp) from which a name is reported as misspelt."""
_VEHICLES = (*VEHICLES, "van")
_SAME_AS = {"van": "car", "person": "pedestrian", "motorcycle": "motorbike"}


def image_class(category: str) -> str:
    """Return the class of the image detectors for this actor category; a van is a car."""
    return _SAME_AS.get(category, category)


def object_category(name: str) -> str | None:
    """Return the class out of eidrive_scenario.detections.CLASSES for a network class; None for other things."""
    if name in CLASSES:
        return name
    known = _SAME_AS.get(name)
    return known if known in CLASSES else None


def light_state(name: str) -> str | None:
    """Return the state in the name of a traffic light class; None for all other classes."""
    if name == LIGHT:
        return "unknown"
    return name.removeprefix(f"{LIGHT} ") if name.startswith(f"{LIGHT} ") else None


def misspelt(name: str) -> str | None:
    """Return the class whose name is very similar to this name; None for classes that are in use, and if none is
    similar.

    Networks distinguish many things that are not used here, so an unknown name is not an error by itself.
    """
    state = light_state(name)
    if object_category(name) or name == STOP_SIGN or (state and (state in ("off", "unknown") or _lights_a_lamp(state))):
        return None
    near = get_close_matches(name, (*CLASSES, *_SAME_AS, LIGHT, *IMAGE_CLASSES), n=1, cutoff=VERY_LIKE)
    return near[0] if near else None


def _lights_a_lamp(state: str) -> bool:
    return any(mode != OFF for _, mode in lamps(state))


def suppression_groups(names: Sequence[str]) -> NDArray[np.int64]:
    """Return the group (C,) of each class: overlapping boxes of one group are one object.

    A traffic light has one state, so its states are one group; a vehicle is not both a car and a truck.
    """
    groups: dict[str, int] = {}
    keys = [LIGHT if light_state(name) else "vehicle" if name in _VEHICLES else name for name in names]
    return np.array([groups.setdefault(key, len(groups)) for key in keys], dtype=np.int64)
