"""Faces of traffic signs by the numbers of the country or, if unknown, by the name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

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
