"""Reference entities of actions: they are other entities than the actor, and present."""

from __future__ import annotations

from eidrive_scenario.api.actions import ActionBehaviour, EntityAbsentError


def check_other_entity(behaviour: ActionBehaviour, name: str) -> None:
    """Raise ScenarioError if the reference entity of an action is its own actor."""
    if name == behaviour.actor_name:
        raise behaviour.error(f"the reference entity is the actor itself (got {name!r}; expected another entity)")


def check_presence(behaviour: ActionBehaviour, name: str) -> None:
    """Raise EntityAbsentError if the reference entity of an action is absent during the run.

    In Init it may have a speed before it has a position.
    """
    context = behaviour.context
    if context.dt > 0.0 and not context.actors[name].present and name not in context.view:
        raise EntityAbsentError(name)
