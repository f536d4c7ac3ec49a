"""Colors of materials, body paints, and the reflection of light by surfaces."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Floats

Color = tuple[float, float, float]

MATERIALS: dict[str, Color] = {
    "glass": (0.09, 0.12, 0.16),
    "window": (0.32, 0.42, 0.50),
    "trim": (0.07, 0.07, 0.08),
    "plastic": (0.16, 0.16, 0.17),
    "tire": (0.05, 0.05, 0.05),
    "rim": (0.62, 0.64, 0.66),
    "chrome": (0.75, 0.76, 0.78),
    "headlight": (0.96, 0.96, 0.88),
    "taillight": (0.72, 0.03, 0.03),
    "indicator_left": (0.95, 0.50, 0.05),
    "indicator_right": (0.95, 0.50, 0.05),
    "marker_light": (0.95, 0.50, 0.05),
    "reversing_light": (0.88, 0.88, 0.86),
    "plate": (0.92, 0.92, 0.90),
    "blue_light": (0.05, 0.18, 0.95),
    "white": (0.93, 0.93, 0.92),
    "red": (0.74, 0.05, 0.04),
    "yellow": (0.93, 0.76, 0.08),
    "gray": (0.50, 0.51, 0.52),
    "steel": (0.60, 0.62, 0.64),
    "cargo": (0.86, 0.86, 0.84),
    "skin": (0.80, 0.60, 0.47),
    "hair": (0.14, 0.09, 0.06),
    "trousers": (0.15, 0.18, 0.27),
    "shoes": (0.08, 0.06, 0.05),
    "leather": (0.12, 0.10, 0.09),
    "orange": (0.92, 0.42, 0.06),
    "roof": (0.34, 0.32, 0.31),
    "grass": (0.36, 0.44, 0.26),
    "asphalt": (0.27, 0.27, 0.28),
    "pavement": (0.58, 0.57, 0.55),
    "concrete": (0.62, 0.61, 0.58),
    "bark": (0.24, 0.18, 0.13),
    "leaves": (0.20, 0.33, 0.12),
    "needles": (0.12, 0.24, 0.13),
    "sign_red": (0.70, 0.04, 0.05),
    "sign_white": (0.93, 0.93, 0.92),
    "sign_yellow": (0.93, 0.74, 0.06),
    "sign_blue": (0.03, 0.22, 0.55),
    "sign_black": (0.04, 0.04, 0.04),
}

PAINTS: tuple[Color, ...] = (
    (0.90, 0.90, 0.89), (0.12, 0.13, 0.15), (0.55, 0.57, 0.59), (0.63, 0.09, 0.09), (0.10, 0.22, 0.48),
    (0.30, 0.33, 0.36), (0.16, 0.34, 0.26), (0.72, 0.66, 0.54), (0.80, 0.44, 0.10), (0.34, 0.52, 0.66),
)  # fmt: skip
"""Body paints; the name of an actor selects one."""

CLOTHES: tuple[Color, ...] = (
    (0.70, 0.16, 0.14), (0.16, 0.36, 0.62), (0.24, 0.46, 0.28),
    (0.86, 0.74, 0.30), (0.42, 0.24, 0.46), (0.85, 0.84, 0.80),
)  # fmt: skip

FACADES: tuple[Color, ...] = (
    (0.72, 0.62, 0.50), (0.66, 0.40, 0.32), (0.74, 0.72, 0.66), (0.55, 0.57, 0.60), (0.80, 0.74, 0.60),
)  # fmt: skip

FIXED_PAINT: dict[str, Color] = {
    "firetruck": MATERIALS["red"],
    "ambulance": MATERIALS["white"],
    "bus": (0.86, 0.62, 0.10),
    "rsu": MATERIALS["steel"],
    "box": (0.78, 0.55, 0.28),
}
"""Body paints by shape that do not depend on the name."""


def paint(name: str, shape: str) -> Color:
    """Return the paint of an actor without a specified color, identical in all processes."""
    if shape in FIXED_PAINT:
        return FIXED_PAINT[shape]
    return by_name(name, CLOTHES if shape in ("pedestrian", "bicycle", "motorbike") else PAINTS)


def by_name(name: str, colors: tuple[Color, ...]) -> Color:
    """Return one of the colors by a hash of the name."""
    return colors[int.from_bytes(hashlib.blake2b(name.encode(), digest_size=4).digest(), "little") % len(colors)]


class Finish(NamedTuple):
    """Finish of a surface.

    mirror    share of light that is reflected specularly at normal incidence
    grain     variation of its albedo between positions
    soaks     whether rain darkens it and forms a film on it
    returns   luminance towards a lamp beside the camera per illuminance [cd/m²/lx]
    """

    mirror: float = 0.0
    grain: float = 0.0
    soaks: bool = False
    returns: float = 0.0


FINISHES: dict[str, Finish] = {
    "matt": Finish(),
    "road": Finish(grain=0.22, soaks=True),
    "soil": Finish(grain=0.35),
    "marking": Finish(grain=0.10, soaks=True, returns=0.15),
    "paint": Finish(mirror=0.05),
    "glass": Finish(mirror=0.10),
    "window": Finish(mirror=0.09),
    "metal": Finish(mirror=0.55),
    "lens": Finish(mirror=0.06),
    "sheeting": Finish(returns=50.0),
    "reflector": Finish(mirror=0.05, returns=2.0),
}
"""Finishes: clear coat and glass have 0.04 for one face of index 1.5 (Fresnel).

Markings have 150 mcd/m²/lx as EN 1436 class R3 requires, and signs 50 cd/m²/lx as EN 12899-1 class RA1 requires.
"""

_BY_MATERIAL = {
    "driving": "road", "junction": "road", "shoulder": "road", "parking": "road", "biking": "road", "asphalt": "road",
    "sidewalk": "road", "curb": "road", "pavement": "road",
    "median": "soil", "verge": "soil", "grass": "soil",
    "marking_white": "marking", "marking_yellow": "marking",
    "paint": "paint", "white": "paint", "red": "paint", "yellow": "paint", "cargo": "paint",
    "glass": "glass", "window": "window", "window_lit": "window",
    "chrome": "metal", "rim": "metal", "steel": "metal",
    "headlight": "lens", "indicator_left": "lens", "indicator_right": "lens", "marker_light": "lens",
    "reversing_light": "lens", "blue_light": "lens", "taillight": "reflector",
    "plate": "sheeting", "sign_red": "sheeting", "sign_white": "sheeting", "sign_yellow": "sheeting",
    "sign_blue": "sheeting", "leaves": "soil", "needles": "soil",
}  # fmt: skip

_NUMBERS = {name: number for number, name in enumerate(FINISHES)}

MIRROR: Floats = np.array([finish.mirror for finish in FINISHES.values()], dtype=np.float32)
GRAIN: Floats = np.array([finish.grain for finish in FINISHES.values()], dtype=np.float32)
SOAKS = np.array([finish.soaks for finish in FINISHES.values()])
RETURNS: Floats = np.array([finish.returns for finish in FINISHES.values()], dtype=np.float32)


def finish_of(material: str) -> int:
    """Return the index of the finish of a material, matt by default."""
    return _NUMBERS[_BY_MATERIAL.get(material, "matt")]
