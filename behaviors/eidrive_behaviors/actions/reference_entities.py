"""Reference entities of actions: an actor has no distance to itself."""

from __future__ import annotations

from eidrive_scenario.api.actions import ActionBehaviour


def check_other_entity(behaviour: ActionBehaviour, name: str) -> None:
    """Raise ScenarioError if the reference entity of an action is its own actor."""
    if name == behaviour.actor_name:
        raise behaviour.error(f"the reference entity is the actor itself (got {name!r}; expected another entity)")
