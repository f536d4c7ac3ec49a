"""Reflection properties of surfaces by material."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Floats


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
