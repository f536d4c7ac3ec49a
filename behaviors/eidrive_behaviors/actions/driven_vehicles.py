"""Actions that have no effect on a driven vehicle, or not the whole one."""

from __future__ import annotations

from eidrive_scenario.api.actions import ActionBehaviour


def warn_without_effect(behaviour: ActionBehaviour) -> None:
    """Add a warning to the result: the driving stack of the actor has no goal for the action."""
    what = f"no effect on {behaviour.actor.name!r}, which a driving stack drives"
    behaviour.context.warn(*behaviour.error(what, "command its speed, route, lane or trajectory").diagnostics)


def warn_of_reverse(behaviour: ActionBehaviour, speed: float) -> None:
    """Add a warning to the result if a target speed is negative [m/s]: driving stacks plan forward motion only."""
    if speed < 0.0:
        what = f"{behaviour.actor.name!r} stops instead of reversing: a driving stack drives forwards only"
        hint = "drive it in reverse by the storyboard, without a driving stack"
        behaviour.context.warn(*behaviour.error(what, hint).diagnostics)


def warn_of_missed_end(behaviour: ActionBehaviour) -> None:
    """Add a warning to the result: the actor has passed the end of its trajectory at a distance."""
    what = f"the action does not end: {behaviour.actor.name!r} passes the end of the trajectory at a distance"
    hint = "start before the trajectory, as driving stacks do not turn around"
    behaviour.context.warn(*behaviour.error(what, hint).diagnostics)
