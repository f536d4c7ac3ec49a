"""Warnings of a road file, grouped by kind.

Real maps have many small errors of one kind. Each kind is reported once, with its first line and a count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from eidrive_scenario.errors import Diagnostic

SHOWN = 4
"""Maximum number of further lines that a grouped warning lists."""


class MapRule(Enum):
    """Rules of `eidrive check` about road files with their summaries, in the order of their listing.

    The level of all of them is warning.
    """

    GEOMETRY_GAP = "a road whose geometries do not join"
    HEADING_DISCONTINUITY = "a road whose heading changes abruptly"
    LANE_WIDTH = "a lane with a missing, negative or implausible width"
    LANE_SIDE = "a lane on the wrong side of the center lane"
    EMPTY_LANE_SECTION = "a lane section with only the center lane"
    LANE_DIRECTION = "a lane whose direction differs from that of its id in another lane section"
    LANE_LAYER = "a temporary layer of lanes, which is not read"
    ROAD_LINK = "a link to a missing road or junction, or to a point within a road"
    ROAD_SURFACE = "a cross section that is not read, or a superelevation that is too steep"
    ROAD_MARK = "an incomplete road mark"
    SIGNAL_OFF_ROAD = "a signal beyond the ends of its road, or for lanes that do not exist"
    OBJECT_OFF_ROAD = "an object, or a repetition of one, beyond the ends of its road"
    OBJECT_SIZE = "an object of negative size"
    LANE_LINK = "a lane link to a missing lane, or a lane without a successor"
    JUNCTION_CONNECTION = "a connection that does not match its junction"

    @property
    def id(self) -> str:
        """Name of the rule in `eidrive check`."""
        return self.name.lower().replace("_", "-")


@dataclass(frozen=True)
class MapWarning:
    """Violation of a map rule at one element; violations of the same kind are reported together."""

    rule: MapRule
    kind: str
    message: str
    hint: str
    line: int | None


def group_map_warnings(warnings: Iterable[MapWarning], source: str) -> tuple[Diagnostic, ...]:
    """Return one diagnostic for each kind of warning, with its rule of `eidrive check`."""
    kinds: dict[tuple[MapRule, str], list[MapWarning]] = {}
    for warning in warnings:
        kinds.setdefault((warning.rule, warning.kind), []).append(warning)
    diagnostics = []
    for first, *others in kinds.values():
        message = first.message
        if others:
            lines = ", ".join([*(str(warning.line) for warning in others[:SHOWN]), *["…"] * (len(others) > SHOWN)])
            message += f"; {len(others)} more of {first.kind}: line {lines}"
        diagnostics.append(Diagnostic(message, first.hint, source, first.line, first.rule.id))
    return tuple(diagnostics)
