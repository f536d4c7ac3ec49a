"""EnvironmentAction: time of day, weather and road condition."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, model


class EnvironmentAction(ActionBehaviour):
    """Sets the environment at once; its clock starts now."""

    action: model.EnvironmentAction

    def update(self) -> Status:
        """Set it."""
        environment = self._environment()
        self.stage.environment = environment
        self.stage.environment_since = self.stage.time
        self.stage.commands.environment = environment
        return Status.SUCCESS

    def _environment(self) -> model.Environment:
        if self.action.environment is not None:
            return self.action.environment
        return self.stage.catalog_entry(self.action.catalog_reference, model.Environment)

    def describe(self) -> str:
        """Which one."""
        return f"environment {self._environment().name}"
