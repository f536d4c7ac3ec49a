"""Rules of `eidrive check` that need the roads; those that need nothing but the file are in `openscenario.lint`."""

from __future__ import annotations

from eidrive_scenario.checks.road_rules import paths, road_file, stations
from eidrive_scenario.checks.road_rules import positions as places
from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.scenario_rules import Level, Rule

ROAD_RULES: tuple[Rule[RoadLintContext], ...] = (
    Rule("unresolvable-position", Level.ERROR, "a position that the road network does not have", places.missing_places),
    Rule("s-out-of-range", Level.WARNING, "an s beyond the end of its road", places.beyond_ends),
    Rule("no-route", Level.ERROR, "a route between whose waypoints no lanes lead", paths.impossible_routes),
    Rule("unknown-lane", Level.WARNING, "a change to a lane that no road has", places.missing_lanes),
    Rule("unknown-signal", Level.WARNING, "a traffic signal that no road has", places.missing_signals),
    Rule("trajectory-off-road", Level.WARNING, "a trajectory that leaves the road", paths.trajectories_off_road),
    Rule("waypoint-off-road", Level.WARNING, "a waypoint beside the road", paths.waypoints_off_road),
    Rule(
        "conflict-area-off-road",
        Level.WARNING,
        "a conflict area that lies off the road",
        stations.conflict_areas_off_road,
    ),
    Rule(
        "geometry-gap", Level.WARNING, "a road whose geometries do not join", road_file.map_warning_rule("geometry-gap")
    ),
    Rule(
        "heading-discontinuity",
        Level.WARNING,
        "a road that bends at a point",
        road_file.map_warning_rule("heading-discontinuity"),
    ),
    Rule("lane-width", Level.WARNING, "a lane without a width, or below 0", road_file.map_warning_rule("lane-width")),
    Rule("lane-side", Level.WARNING, "a lane on the side of the others", road_file.map_warning_rule("lane-side")),
    Rule("road-link", Level.WARNING, "a road that leads to no junction", road_file.map_warning_rule("road-link")),
    Rule(
        "road-surface",
        Level.WARNING,
        "heights across a road that are not read, or too steep",
        road_file.map_warning_rule("road-surface"),
    ),
    Rule("road-mark", Level.WARNING, "a road mark that is not complete", road_file.map_warning_rule("road-mark")),
    Rule(
        "signal-off-road",
        Level.WARNING,
        "a signal beyond the ends of its road",
        road_file.map_warning_rule("signal-off-road"),
    ),
    Rule("lane-link", Level.WARNING, "a lane that does not go on", road_file.map_warning_rule("lane-link")),
    Rule(
        "junction-connection",
        Level.WARNING,
        "a connection that does not fit its junction",
        road_file.map_warning_rule("junction-connection"),
    ),
)
"""The rules that ask where something is."""

__all__ = ["ROAD_RULES", "RoadLintContext"]
