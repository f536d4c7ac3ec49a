"""Rules of `eidrive check` that need the road network."""

from __future__ import annotations

from eidrive_scenario.checks.road_rules import paths, positions
from eidrive_scenario.checks.road_rules.context import ROAD_FILE_RULES, RoadFileContext, RoadLintContext
from eidrive_scenario.checks.rule import Level, Rule

ROAD_RULES: tuple[Rule[RoadLintContext], ...] = (
    Rule(
        "unresolvable-position",
        Level.ERROR,
        "a position that the road network does not contain",
        positions.unresolvable_positions,
    ),
    Rule("s-out-of-range", Level.WARNING, "an s beyond the end of its road", positions.s_out_of_range),
    Rule("no-route", Level.ERROR, "a route whose waypoints no lanes connect", paths.impossible_routes),
    Rule("unknown-lane", Level.WARNING, "a lane change to a lane that no road has", positions.unknown_lanes),
    Rule("unknown-signal", Level.WARNING, "a traffic signal that no road has", positions.unknown_signals),
    Rule("trajectory-off-road", Level.WARNING, "a trajectory that leaves the road", paths.trajectories_off_road),
    Rule("waypoint-off-road", Level.WARNING, "a waypoint or a destination outside the road", paths.waypoints_off_road),
    Rule(
        "conflict-area-off-road", Level.WARNING, "a conflict area outside the road", positions.conflict_areas_off_road
    ),
)
"""Rules that need a scenario and its road network."""

__all__ = ["ROAD_FILE_RULES", "ROAD_RULES", "RoadFileContext", "RoadLintContext"]
