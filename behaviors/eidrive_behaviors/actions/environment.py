"""EnvironmentAction: time of day, weather and road condition."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, merge_environment, model


class EnvironmentAction(ActionBehaviour):
    """Immediate change of the environment. Omitted parts keep their values; a time of day restarts the clock."""

    immediate = True
    action: model.EnvironmentAction

    def update(self) -> Status:
        """Set the environment."""
        context = self.context
        merged = merge_environment(context.environment, self._environment(), max(context.time, 0.0))
        context.set_environment(merged)
        return Status.SUCCESS

    def _environment(self) -> model.Environment:
        action = self.action
        return action.environment or self.context.catalog_entry(action.catalog_reference, model.Environment, action)

    def describe(self) -> str:
        """Describe the environment by its name."""
        return f"environment {self._environment().name}"
