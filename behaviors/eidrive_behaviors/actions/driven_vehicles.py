"""Actions that have no effect on a driven vehicle."""

from __future__ import annotations

from eidrive_scenario.api.actions import ActionBehaviour


def warn_without_effect(behaviour: ActionBehaviour) -> None:
    """Add a warning to the result: the driving stack of the actor has no goal for the action."""
    what = f"no effect on {behaviour.actor.name!r}, which a driving stack drives"
    behaviour.context.warn(*behaviour.error(what, "command its speed, route, lane or trajectory").diagnostics)
