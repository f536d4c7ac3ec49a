"""Warnings of a road file, grouped by kind.

Real maps have many small errors of one kind. Each kind is reported once, with its first line and a count.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from eidrive_scenario.errors import Diagnostic

SHOWN = 4
"""Maximum number of further lines that a grouped warning lists."""


@dataclass(frozen=True)
class MapRule:
    """Name and summary of a rule of `eidrive check` about road files. The level of all of them is warning."""

    name: str
    summary: str


GEOMETRY_GAP = MapRule("geometry-gap", "a road whose geometries do not join")
HEADING_DISCONTINUITY = MapRule("heading-discontinuity", "a road whose heading changes abruptly")
LANE_WIDTH = MapRule("lane-width", "a lane with a missing, negative or implausible width")
LANE_SIDE = MapRule("lane-side", "a lane on the wrong side of the center lane")
EMPTY_LANE_SECTION = MapRule("empty-lane-section", "a lane section with only the center lane")
LANE_LAYER = MapRule("lane-layer", "a temporary layer of lanes, which is not read")
ROAD_LINK = MapRule("road-link", "a link to a missing junction, or to a point within a road")
ROAD_SURFACE = MapRule("road-surface", "a cross section that is not read, or a superelevation that is too steep")
ROAD_MARK = MapRule("road-mark", "an incomplete road mark")
SIGNAL_OFF_ROAD = MapRule("signal-off-road", "a signal beyond the ends of its road")
LANE_LINK = MapRule("lane-link", "a lane link to a missing lane, or a lane without a successor")
JUNCTION_CONNECTION = MapRule("junction-connection", "a connection that does not match its junction")

MAP_RULES = (
    GEOMETRY_GAP,
    HEADING_DISCONTINUITY,
    LANE_WIDTH,
    LANE_SIDE,
    EMPTY_LANE_SECTION,
    LANE_LAYER,
    ROAD_LINK,
    ROAD_SURFACE,
    ROAD_MARK,
    SIGNAL_OFF_ROAD,
    LANE_LINK,
    JUNCTION_CONNECTION,
)
"""All rules about road files, in the order of their listing."""


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
    return tuple(_group_diagnostic(group, source) for group in kinds.values())


def _group_diagnostic(group: list[MapWarning], source: str) -> Diagnostic:
    first = group[0]
    message = first.message
    if len(group) > 1:
        lines = [str(warning.line) for warning in group[1 : 1 + SHOWN]]
        more = ", …" if len(group) > 1 + SHOWN else ""
        message += f"; {len(group) - 1} more of {first.kind}: line {', '.join(lines)}{more}"
    return Diagnostic(message, first.hint, source, first.line, first.rule.name)
