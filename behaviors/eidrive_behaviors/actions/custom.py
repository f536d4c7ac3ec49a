"""CustomCommandAction: what the standard has no word for, handed on to whoever understands its type."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, CustomCommand, model


class CustomCommandAction(ActionBehaviour):
    """Hands its type and text on, once. It never starts a program."""

    immediate = True
    action: model.CustomCommandAction

    def update(self) -> Status:
        """Hand it on."""
        action = self.action
        self.context.commands.custom.append(
            CustomCommand(action.type, action.content, action.line, action.source, action.scope)
        )
        return Status.SUCCESS

    def describe(self) -> str:
        """Type and text."""
        return f"command {self.action.type}: {' '.join(self.action.content.split())}"
