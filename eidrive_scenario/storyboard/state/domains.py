"""The domains of an actor that actions control."""

from __future__ import annotations

from enum import Flag, auto


class Domain(Flag):
    """What of an actor an action controls. Of two actions on one domain the younger ends the older."""

    NONE = 0
    LONGITUDINAL = auto()
    LATERAL = auto()
    LIGHTING = auto()
    ANIMATION = auto()
