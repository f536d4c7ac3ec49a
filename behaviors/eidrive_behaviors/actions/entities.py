"""AddEntityAction and DeleteEntityAction: who is in the world."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_behaviors.actions.teleport import position_in_words
from eidrive_scenario.api.actions import ActionBehaviour, model, resolve_position


class AddEntityAction(ActionBehaviour):
    """Brings the entity that the surrounding EntityAction names into the world; one that is there is moved."""

    action: model.AddEntityAction
    parent_element: model.EntityAction

    def update(self) -> Status:
        """Bring it in."""
        name = self.parent_element.entity_ref
        self.context.add_actor(name, resolve_position(self.action.position, self.context, name))
        return Status.SUCCESS

    def describe(self) -> str:
        """Whom, and where."""
        return f"add {self.parent_element.entity_ref} at {position_in_words(self.action.position)}"


class DeleteEntityAction(ActionBehaviour):
    """Takes the entity that the surrounding EntityAction names out of the world; what it was doing ends."""

    action: model.DeleteEntityAction
    parent_element: model.EntityAction

    def update(self) -> Status:
        """Take it out."""
        self.context.remove_actor(self.parent_element.entity_ref)
        return Status.SUCCESS

    def describe(self) -> str:
        """Whom."""
        return f"delete {self.parent_element.entity_ref}"
