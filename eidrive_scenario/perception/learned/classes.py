"""What the learned detectors tell apart, and what of it is an object on the road."""

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

VERY_LIKE = 0.85
"""Names that are so like to one of a class (ratio of Ratcliff and Obershelp) are slips."""
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


def misspelt(name: str) -> str | None:
    """The class that a name of one which means nothing here is very like to; None for all other names, as networks tell
    many more things apart than are of use here."""
    state = light_state(name)
    if object_category(name) or name == STOP_SIGN or (state and (state in ("off", "unknown") or _lights_a_lamp(state))):
        return None
    near = get_close_matches(name, (*CLASSES, *_SAME_AS, LIGHT, *IMAGE_CLASSES), n=1, cutoff=VERY_LIKE)
    return near[0] if near else None


def _lights_a_lamp(state: str) -> bool:
    return any(mode != OFF for _, mode in lamps(state))


def suppression_groups(names: Sequence[str]) -> NDArray[np.int64]:
    """(C,) group of each class: of two boxes of one group on one place, only the better one counts.

    One lamp cannot be red and green, so the states of a light are a group; a vehicle is not a car and a truck.
    """
    groups: dict[str, int] = {}
    keys = [LIGHT if light_state(name) else "vehicle" if name in _VEHICLES else name for name in names]
    return np.array([groups.setdefault(key, len(groups)) for key in keys], dtype=np.int64)
