"""EnvironmentAction: time of day, weather and road condition."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, merge_environment, model


class EnvironmentAction(ActionBehaviour):
    """Sets the environment at once; what it leaves out stays as it is. A time of day starts the clock anew."""

    immediate = True
    action: model.EnvironmentAction

    def update(self) -> Status:
        """Set it."""
        context = self.context
        context.environment = merge_environment(context.environment, self._environment(), max(context.time, 0.0))
        context.commands.environment = context.environment
        return Status.SUCCESS

    def _environment(self) -> model.Environment:
        if self.action.environment is not None:
            return self.action.environment
        return self.context.catalog_entry(self.action.catalog_reference, model.Environment, self.action)

    def describe(self) -> str:
        """Which one."""
        return f"environment {self._environment().name}"
