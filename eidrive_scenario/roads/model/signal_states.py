"""Lamps of traffic lights by the text of a signal state.

The standard leaves this text to the tools. Supported are lists of lamps from top to bottom as in esmini ("on;off;off"),
colors ("red", "redYellow", "GREEN" of CARLA, "green solidOn circle" of tier4), and the semantic states of the user
guide of the standard ("go", "caution", "stop").
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache

from eidrive_scenario.roads.model.road_map import Signal

ON, OFF, FLASHING = "on", "off", "flashing"
RED, YELLOW, GREEN = "red", "yellow", "green"

FLASHES_PER_SECOND = 1.0
"""Frequency of a flashing lamp [Hz], which is lit in the first half of each period."""

DEFAULT_LAMPS = (RED, YELLOW, GREEN)
"""Default lamps of a traffic light from top to bottom."""
_COLORS: Mapping[int, tuple[str, ...]] = {1: (YELLOW,), 2: (RED, GREEN), 3: DEFAULT_LAMPS}
"""Lamps of a traffic light by their number."""
_TYPES: Mapping[str, tuple[str, ...]] = {"1000002": (RED, GREEN), "1000009": (RED, YELLOW), "1000013": (RED, GREEN)}
"""Types of the OpenDRIVE signal catalog whose lamps differ from red, yellow and green."""

_MODES = {"on": ON, "off": OFF, "flashing": FLASHING, "blinking": FLASHING, "true": ON, "false": OFF}
_WORDS = {
    **{"red": RED, "stop": RED, "halt": RED},
    **{"yellow": YELLOW, "amber": YELLOW, "orange": YELLOW, "caution": YELLOW, "attention": YELLOW, "warning": YELLOW},
    **{"green": GREEN, "go": GREEN, "walk": GREEN},
}
_NEGATIONS = frozenset({"no", "not", "dont", "don"})
"""Words that turn a state for going into its opposite; `don` is that of "don't"."""
_FLASHES = frozenset({"flashing", "flash", "blinking", "blink"})


def lamp_colors(signal: Signal) -> tuple[str, ...]:
    """Return the lamps of a traffic light from top to bottom; empty for a sign."""
    return _TYPES.get(signal.type, DEFAULT_LAMPS) if signal.dynamic else ()


@lru_cache(maxsize=1024)
def lamps(state: str, colors: tuple[str, ...] = DEFAULT_LAMPS) -> tuple[tuple[str, str], ...]:
    """Return the color and mode (on, off, flashing) of each lamp in a state from top to bottom.

    A state may list another number of lamps than the type of the light; the list then has priority. All lamps are off
    in an unsupported state.
    """
    # The modes of a list of lamps, or None if the state is not such a list
    words = [word.strip().lower() for word in re.split("[;,]", state)]
    modes = [_MODES[word] for word in words] if all(word in _MODES for word in words) else None
    if modes is not None and (len(modes) > 1 or len(colors) == 1):
        if len(modes) != len(colors):
            colors = _COLORS.get(len(modes), (*DEFAULT_LAMPS, *[GREEN] * len(modes))[: len(modes)])
        return tuple(zip(colors, modes, strict=True))
    lit = _named(state)
    return tuple((color, lit.get(color, OFF)) for color in colors)


def lit(state: str, colors: tuple[str, ...], time: float) -> tuple[bool, ...]:
    """Return whether each lamp is lit at `time` [s], from top to bottom."""
    in_lit_phase = (time * FLASHES_PER_SECOND + 1e-9) % 1.0 < 0.5
    return tuple(mode == ON or (mode == FLASHING and in_lit_phase) for _, mode in lamps(state, colors))


def must_stop(state: str, colors: tuple[str, ...] = DEFAULT_LAMPS) -> bool:
    """Return whether a light in this state requires traffic to stop: red, or steady yellow without green."""
    shown = dict(lamps(state, colors))
    red, yellow, green = (shown.get(color, OFF) for color in (RED, YELLOW, GREEN))
    return red != OFF or (yellow == ON and green == OFF)


def shows_red(state: str, colors: tuple[str, ...] = DEFAULT_LAMPS) -> bool:
    """Return whether a light in this state shows red, also together with yellow or flashing."""
    return dict(lamps(state, colors)).get(RED, OFF) != OFF


def _named(state: str) -> dict[str, str]:
    """Return the lit lamps of a textual state with their modes."""
    modes: dict[str, str] = {}
    for part in re.split("[;,]", state):
        words = [word.lower() for word in re.findall("[A-Z]+(?![a-z])|[A-Z]?[a-z]+", part)]
        if "off" in words:
            continue
        flashes = not _FLASHES.isdisjoint(words)
        colors: Sequence[str] = [_WORDS[word] for word in words if word in _WORDS]
        if not _NEGATIONS.isdisjoint(words):
            colors = [RED] if GREEN in colors else []
        for color in colors or ([YELLOW] if flashes else []):
            modes[color] = FLASHING if flashes else ON
    return modes
