"""Prior distributions of the sizes of road users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class SizePrior(NamedTuple):
    """Mean length, width and height of a class [m], their standard deviations, and the share in traffic."""

    mean: tuple[float, float, float]
    deviation: tuple[float, float, float]
    share: float


PRIORS: Mapping[str, SizePrior] = {
    "car": SizePrior((4.6, 1.85, 1.55), (0.35, 0.12, 0.15), 0.60),
    "van": SizePrior((5.7, 2.1, 2.4), (0.5, 0.15, 0.25), 0.10),
    "truck": SizePrior((8.2, 2.6, 3.5), (1.2, 0.25, 0.4), 0.08),
    "bus": SizePrior((11.3, 2.7, 3.4), (1.0, 0.35, 0.5), 0.04),
    "motorbike": SizePrior((2.2, 0.8, 1.5), (0.2, 0.15, 0.2), 0.03),
    "bicycle": SizePrior((1.8, 0.6, 1.65), (0.15, 0.12, 0.2), 0.05),
    "pedestrian": SizePrior((0.55, 0.55, 1.72), (0.15, 0.15, 0.15), 0.10),
    "child": SizePrior((0.4, 0.4, 1.3), (0.1, 0.1, 0.2), 0.02),
    "pole": SizePrior((0.3, 0.3, 3.5), (0.15, 0.15, 1.5), 0.03),
}
"""Rounded values for European traffic; two-wheelers include their riders. Poles and masts appear in point clouds beside
road users; their class prevents that they are detected as road users. Children are pedestrians, but one normal
distribution does not cover adults and them: their median heights at 3 to 14 years are 0.95 to 1.6 m (growth reference
of the WHO)."""

REPORTED: Mapping[str, str] = {"child": "pedestrian"}
"""Classes of detections that differ from the class of the size."""

UNKNOWN = SizePrior((1.0, 1.0, 1.2), (0.6, 0.6, 0.6), 0.01)
"""Prior of a class that the table does not have."""

CONFUSED: Mapping[str, tuple[str, ...]] = {"car": ("van",), "truck": ("van", "bus"), "bus": ("truck",)}
"""Other classes of objects to which an image detector may give a class: such detectors distinguish few classes."""

LARGEST = (14.0, 4.5, 4.8)
"""Maximum size of a road user [m]."""


def prior_of(name: str) -> SizePrior:
    """Return the prior of a class, or UNKNOWN if the table has none."""
    return PRIORS.get(name, UNKNOWN)


def possible_classes(name: str) -> tuple[str, ...]:
    """Return the classes of objects to which an image detector may give the class `name`, which is the first one."""
    return (name, *CONFUSED.get(name, ()))
