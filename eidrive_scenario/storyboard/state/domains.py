"""Control domains of an actor (ASAM OpenSCENARIO XML 1.3.1, 7.5.1)."""

from __future__ import annotations

from enum import Flag, auto


class Domain(Flag):
    """Domains of an actor that an action controls. An action that acquires a domain ends its previous holder."""

    NONE = 0
    LONGITUDINAL = auto()
    LATERAL = auto()
    LIGHTING = auto()
    ANIMATION = auto()
