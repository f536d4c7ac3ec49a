"""What is likely wrong with a scenario though the schema allows it: one rule, one function, one name.

docs/checks.md says of each rule what it means, with an example that breaks it and the remedy.
"""

from __future__ import annotations

from eidrive_scenario.checks.rule import Level, Rule, at
from eidrive_scenario.checks.scenario_rules import actions, counterparts, declarations, entities, triggers
from eidrive_scenario.checks.scenario_rules.context import LintContext

RULES: tuple[Rule[LintContext], ...] = (
    Rule("no-stop-trigger", Level.WARNING, "nothing says when the run ends", triggers.no_stop_trigger),
    Rule("unreachable", Level.WARNING, "it waits for what never comes", triggers.never_seen("unreachable")),
    Rule("unobserved-edge", Level.WARNING, "an edge that is never seen", triggers.never_seen("unobserved-edge")),
    Rule(
        "impossible-condition",
        Level.WARNING,
        "a condition that can never hold",
        triggers.never_seen("impossible-condition"),
    ),
    Rule(
        "impossible-state",
        Level.WARNING,
        "a state that its element never has",
        triggers.never_seen("impossible-state"),
    ),
    Rule(
        "contradictory-group",
        Level.WARNING,
        "conditions of one group that exclude each other",
        triggers.contradictory_groups,
    ),
    Rule("simultaneous-edges", Level.WARNING, "edges that must come at the same instant", triggers.coinciding_edges),
    Rule("exact-time-comparison", Level.WARNING, "a time that is met exactly or not at all", triggers.equal_times),
    Rule("zero-executions", Level.WARNING, "an element that may not be executed", triggers.zero_executions),
    Rule("no-actors", Level.WARNING, "private actions of nobody", entities.groups_without_actors),
    Rule("entity-without-position", Level.WARNING, "an entity that is nowhere", entities.never_placed),
    Rule("unused-entity", Level.WARNING, "an entity that is never spoken of", entities.unused_entities),
    Rule("zero-wheelbase", Level.WARNING, "a vehicle without a wheelbase", entities.axles_not_apart),
    Rule("self-reference", Level.WARNING, "an action that relates someone to oneself", entities.relations_to_oneself),
    Rule("conflicting-actions", Level.WARNING, "actions of one event that end each other", actions.conflicting_actions),
    Rule("above-max-speed", Level.WARNING, "a speed above the vehicle's maxSpeed", actions.too_fast),
    Rule("zero-rate-transition", Level.NOTE, "a transition at the rate 0", actions.no_progress),
    Rule("untimed-trajectory", Level.WARNING, "times that are missing or all the same", actions.untimed_trajectories),
    Rule("unknown-traffic", Level.WARNING, "a stop of traffic that nobody starts", counterparts.unknown_traffic),
    Rule("unconnected-trailer", Level.WARNING, "a trailer that nothing holds", counterparts.unconnected_trailers),
    Rule("ineffective-parameter-action", Level.WARNING, "a parameter set for nobody", declarations.unread_parameters),
    Rule("unused-parameter", Level.WARNING, "a parameter that nothing uses", declarations.unused_parameters),
    Rule("unused-variable", Level.WARNING, "a variable that nothing uses", declarations.unused_variables),
    Rule("unused-monitor", Level.WARNING, "a monitor that nothing sets", declarations.unused_monitors),
    Rule("unused-selection", Level.WARNING, "a selection that nothing uses", declarations.unused_selections),
    Rule("unused-catalog", Level.NOTE, "a catalog that nothing uses", declarations.unused_catalogs),
)
"""The rules that need nothing but the file and its catalogs."""

__all__ = ["RULES", "Level", "LintContext", "Rule", "at"]
