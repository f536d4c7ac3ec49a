"""CustomCommandAction: a command outside the standard, passed to the receiver that supports its type."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, CustomCommand, model


class CustomCommandAction(ActionBehaviour):
    """Transfer of type and content of the command to its receiver, once. It never starts a program."""

    immediate = True
    action: model.CustomCommandAction

    def update(self) -> Status:
        """Append the command to the commands of the step."""
        action = self.action
        self.context.request_command(
            CustomCommand(action.type, action.content, action.line, action.source, action.scope)
        )
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe type and content."""
        return f"command {self.action.type}: {' '.join(self.action.content.split())}"
