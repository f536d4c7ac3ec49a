"""AddEntityAction and DeleteEntityAction: presence of entities in the world."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_behaviors.actions.routing import describe_position
from eidrive_scenario.api.actions import ActionBehaviour, model, resolve_position


class AddEntityAction(ActionBehaviour):
    """Addition of the entity of the enclosing EntityAction to the world; no effect on a present entity."""

    action: model.AddEntityAction
    parent_element: model.EntityAction

    def update(self) -> Status:
        """Add the entity at its position."""
        name = self.parent_element.entity_ref
        if self.context.actors[name].present:
            message = f"no effect: entity {name!r} is present"
            self.warn(message, "delete it first, or use a TeleportAction")
            return Status.SUCCESS
        self.context.add_actor(name, resolve_position(self.action.position, self.context, name))
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the entity and its position."""
        return f"add {self.parent_element.entity_ref} at {describe_position(self.action.position)}"


class DeleteEntityAction(ActionBehaviour):
    """Removal of the entity of the enclosing EntityAction from the world. Its running actions end."""

    action: model.DeleteEntityAction
    parent_element: model.EntityAction

    def update(self) -> Status:
        """Remove the entity."""
        name = self.parent_element.entity_ref
        if not self.context.actors[name].present:
            message = f"no effect: entity {name!r} is absent"
            self.warn(message, "add it first")
            return Status.SUCCESS
        self.context.remove_actor(name)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the entity."""
        return f"delete {self.parent_element.entity_ref}"
