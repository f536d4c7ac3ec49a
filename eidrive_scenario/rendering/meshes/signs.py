"""Traffic signs: faces by the numbers of the country or, if unknown, by the name, and their meshes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.meshes.solids import Mesh, polygon
from eidrive_scenario.roads import Signal


class SignFace(NamedTuple):
    """Face of a traffic sign.

    shape         octagon, triangle (point up), yield (point down), disc, diamond or board
    fill, border  colors: red, white, yellow, blue, black, or none
    text          digits and letters in the center
    """

    shape: str
    fill: str
    border: str = ""
    text: str = ""


STOP = SignFace("octagon", "red", "white", "STOP")
YIELD = SignFace("yield", "white", "red")
PRIORITY = SignFace("diamond", "yellow", "white")
PROHIBITION = SignFace("disc", "white", "red")
NO_ENTRY = SignFace("disc", "red", "white")
MANDATORY = SignFace("disc", "blue", "white")
WARNING = SignFace("triangle", "white", "red")
END = SignFace("disc", "white", "black")
INFORMATION = SignFace("board", "blue", "white")
OTHER = SignFace("board", "white", "black")

_GERMAN: tuple[tuple[range, SignFace], ...] = (
    (range(101, 200), WARNING),
    (range(205, 206), YIELD),
    (range(206, 207), STOP),
    (range(209, 242), MANDATORY),
    (range(267, 268), NO_ENTRY),
    (range(250, 275), PROHIBITION),
    (range(276, 278), PROHIBITION),
    (range(278, 283), END),
    (range(283, 291), PROHIBITION),
    (range(301, 302), WARNING),
    (range(306, 307), PRIORITY),
    (range(310, 440), INFORMATION),
)
"""Numbers of the German catalog (VzKat), which the OpenDRIVE signal catalog follows."""
_AMERICAN: Mapping[str, SignFace] = {"R1-1": STOP, "R1-2": YIELD, "R2-1": SignFace("board", "white", "black")}
_SWEDISH: Mapping[str, SignFace] = {
    "a": WARNING, "b1": YIELD, "b2": STOP, "b4": PRIORITY, "c1": NO_ENTRY, "c": PROHIBITION, "d": MANDATORY,
    "e": INFORMATION, "f": INFORMATION,
}  # fmt: skip
_WORDS: tuple[tuple[str, SignFace], ...] = (
    ("stop", STOP),
    ("yield", YIELD),
    ("giveway", YIELD),
    ("priority", PRIORITY),
    ("noentry", NO_ENTRY),
    ("speed", PROHIBITION),
    ("warning", WARNING),
)
LIMITS = ("274", "R2-1", "c31", "jin", "maximum speed")
"""Types of speed limits."""


def sign_face(signal: Signal) -> SignFace:
    """Return the face of a sign; that of a speed limit contains its number."""
    kind, country = signal.type.strip(), signal.country.strip().upper()
    subtype = signal.subtype.strip()
    whole = f"{kind.lower()}{subtype}"
    name = re.sub("[^a-z]", "", signal.name.lower())
    face = _AMERICAN.get(kind)
    if face is None and country in ("SE", "SWEDEN"):
        face = _SWEDISH.get(whole) or _SWEDISH.get(kind.lower())
    if face is None and kind.isdecimal():
        face = next((each for numbers, each in _GERMAN if int(kind) in numbers), None)
    if face is None:
        face = next((each for word, each in _WORDS if word in name), OTHER)
    if kind in LIMITS or whole in LIMITS or (face is PROHIBITION and "speed" in name):
        return face._replace(text=_limit(signal))
    return face


def _limit(signal: Signal) -> str:
    """Return the number of a speed limit as shown. Swedish maps give it in tens."""
    numbers = [float(text) for text in re.findall("[0-9]+", signal.name) if 5 <= float(text) <= 140]
    value = signal.value
    if value is not None and 5.0 <= value <= 140.0 and not (value <= 12.0 and numbers):
        return f"{value:.0f}"
    return f"{numbers[0]:.0f}" if numbers else ""


LAYER = 0.004
"""Distance between layers of paint [m]. It exceeds the real one for depth resolution of distant cameras."""
BORDERS = {"octagon": 0.06, "board": 0.05, "diamond": 0.14}
BORDER = 0.12
"""Width of a border as a share of the width of the plate, by shape if it differs from the default."""

GLYPHS = {
    "0": "111101101101111", "1": "010110010010111", "2": "111001111100111", "3": "111001011001111",
    "4": "101101111001001", "5": "111100111001111", "6": "111100111101111", "7": "111001010010010",
    "8": "111101111101111", "9": "111101111001111",
    "S": "111100111001111", "T": "111010010010010", "O": "111101101101111", "P": "111101111100100",
}  # fmt: skip
"""Glyphs of three columns and five lines, from the top left."""


@lru_cache(maxsize=256)
def sign(face: SignFace, width: float, height: float) -> dict[str, Array]:
    """Return triangles (K, 3, 3) of a sign by material."""
    mesh = Mesh()
    outline = _outline(face.shape, width, height)
    mesh.add("steel", polygon(_at(outline, -LAYER))[:, ::-1])
    middle = np.array([0.0, {"triangle": height / 3, "yield": 2 * height / 3}.get(face.shape, height / 2)])
    mesh.add(f"sign_{face.border or face.fill}", polygon(_at(outline, 0.0)))
    if face.border:
        inner = 1.0 - 2.0 * BORDERS.get(face.shape, BORDER if face != NO_ENTRY else 0.03)
        mesh.add(f"sign_{face.fill}", polygon(_at(middle + inner * (outline - middle), LAYER)))
    if face == NO_ENTRY:
        bar = np.array([(-0.36, -0.08), (0.36, -0.08), (0.36, 0.08), (-0.36, 0.08)]) * (width, height)
        mesh.add("sign_white", polygon(_at(middle + bar, 2 * LAYER)))
    if face.text:
        ink = "white" if face.fill in ("red", "blue") else "black"
        mesh.add(f"sign_{ink}", *_letters(face.text, middle, 0.62 * width, 0.42 * height))
    return mesh.materials()


_OUTLINES = {
    "board": ((-1, 0), (1, 0), (1, 2), (-1, 2)),
    "diamond": ((0, 0), (1, 1), (0, 2), (-1, 1)),
    "triangle": ((-1, 0), (1, 0), (0, 2)),
    "yield": ((0, 0), (1, 2), (-1, 2)),
}
"""Corners of plates with straight edges, in half widths and half heights."""


def _outline(shape: str, width: float, height: float) -> Array:
    """Return the corners (M, 2), counter-clockwise as seen by the traffic."""
    half, tall = width / 2, height / 2
    if shape in _OUTLINES:
        return np.array(_OUTLINES[shape]) * (half, tall)
    corners = 8 if shape == "octagon" else 28
    turns = np.arange(corners) * (2 * math.pi / corners) + (math.pi / 8 if shape == "octagon" else 0.0)
    scale = 1.0 / math.cos(math.pi / 8) if shape == "octagon" else 1.0
    return np.stack([half * scale * np.cos(turns), tall + tall * scale * np.sin(turns)], axis=1)


def _letters(text: str, middle: Array, width: float, height: float) -> list[Array]:
    """Return the cells of letters as squares, merged along each line."""
    columns = 4 * len(text) - 1
    cell = min(width / columns, height / 5)
    left, top = -cell * columns / 2, middle[1] + 2.5 * cell
    parts = []
    for number, letter in enumerate(text):
        for line in range(5):
            bits = GLYPHS.get(letter, "0" * 15)[3 * line : 3 * line + 3]
            for run in re.finditer("1+", bits):
                y0 = left + (4 * number + run.start()) * cell
                y1, z1 = y0 + (run.end() - run.start()) * cell, top - line * cell
                corners = np.array([(y0, z1 - cell), (y1, z1 - cell), (y1, z1), (y0, z1)])
                parts.append(polygon(_at(corners, 2 * LAYER)))
    return parts


def _at(corners: Array, x: float) -> Array:
    return np.column_stack([np.full(len(corners), x), corners])
