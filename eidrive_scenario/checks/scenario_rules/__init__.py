"""Rules about probable mistakes in scenarios that the schema allows: one function per rule.

docs/checks.md describes each rule with an example that violates it and the correction.
"""

from __future__ import annotations

from eidrive_scenario.checks.rule import Level, Rule
from eidrive_scenario.checks.scenario_rules import actions, declarations, entities, triggers
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.checks.scenario_rules.truth_intervals import (
    IMPOSSIBLE_CONDITION,
    IMPOSSIBLE_STATE,
    UNOBSERVED_EDGE,
    UNREACHABLE,
)

RULES: tuple[Rule[LintContext], ...] = (
    Rule("no-stop-trigger", Level.WARNING, "a storyboard without a stop trigger", triggers.no_stop_trigger),
    Rule(UNREACHABLE, Level.WARNING, "a wait for a state that is never reached", triggers.never_true(UNREACHABLE)),
    Rule(UNOBSERVED_EDGE, Level.WARNING, "an edge that is never observed", triggers.never_true(UNOBSERVED_EDGE)),
    Rule(
        IMPOSSIBLE_CONDITION,
        Level.WARNING,
        "a condition that can never hold",
        triggers.never_true(IMPOSSIBLE_CONDITION),
    ),
    Rule(
        IMPOSSIBLE_STATE,
        Level.WARNING,
        "a state that its element never has",
        triggers.never_true(IMPOSSIBLE_STATE),
    ),
    Rule(
        "contradictory-group",
        Level.WARNING,
        "conditions of one group that exclude each other",
        triggers.contradictory_groups,
    ),
    Rule("simultaneous-edges", Level.WARNING, "edges that must occur at the same instant", triggers.simultaneous_edges),
    Rule("exact-time-comparison", Level.WARNING, "a comparison with an exact time", triggers.exact_time_comparisons),
    Rule("zero-executions", Level.WARNING, "an element with maximumExecutionCount 0", triggers.zero_executions),
    Rule("no-actors", Level.WARNING, "private actions without actors", entities.groups_without_actors),
    Rule("entity-without-position", Level.WARNING, "an entity that is never placed", entities.unplaced_entities),
    Rule("unused-entity", Level.WARNING, "an entity without references", entities.unused_entities),
    Rule("zero-wheelbase", Level.WARNING, "a vehicle without a wheelbase", entities.zero_wheelbases),
    Rule("self-reference", Level.WARNING, "an action that refers to its own actor", entities.self_references),
    Rule("conflicting-actions", Level.WARNING, "actions of one event that end each other", actions.conflicting_actions),
    Rule("above-max-speed", Level.WARNING, "a speed above the vehicle's maxSpeed", actions.speeds_above_max),
    Rule("zero-rate-transition", Level.NOTE, "a transition with the rate 0", actions.zero_rate_transitions),
    Rule("untimed-trajectory", Level.WARNING, "a trajectory with missing or equal times", actions.untimed_trajectories),
    Rule("unknown-traffic", Level.WARNING, "a stop of traffic that no action starts", entities.unknown_traffic),
    Rule("traffic-stack", Level.WARNING, "a driving stack of background traffic", entities.traffic_with_stacks),
    Rule("unconnected-trailer", Level.WARNING, "a trailer without hitch or coupler", entities.unconnected_trailers),
    Rule(
        "ineffective-parameter-action",
        Level.WARNING,
        "a set parameter that no condition reads",
        declarations.ineffective_parameter_actions,
    ),
    Rule("unused-parameter", Level.WARNING, "a parameter without references", declarations.unused_parameters),
    Rule("unused-variable", Level.WARNING, "a variable without references", declarations.unused_variables),
    Rule("unused-monitor", Level.WARNING, "a monitor that no action sets", declarations.unused_monitors),
    Rule("unused-selection", Level.WARNING, "a selection without references", declarations.unused_selections),
    Rule("unused-catalog", Level.NOTE, "a catalog location without references", declarations.unused_catalogs),
)
"""Rules that need only the file and its catalogs."""
