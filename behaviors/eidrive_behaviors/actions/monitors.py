"""SetMonitorAction: tell an observer of the run."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class SetMonitorAction(ActionBehaviour):
    """Sets a monitor that the scenario declares; frames, metrics and the criterion `monitor` show its value."""

    immediate = True
    action: model.SetMonitorAction

    def update(self) -> Status:
        """Set it."""
        self.context.monitors = {**self.context.monitors, self.action.monitor_ref: self.action.value}
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"monitor {self.action.monitor_ref} is {str(self.action.value).lower()}"
