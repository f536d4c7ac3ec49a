"""SetMonitorAction: set a monitor of the run."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class SetMonitorAction(ActionBehaviour):
    """Assignment of a declared monitor. Its value is in frames, in metrics and in the criterion `monitor`."""

    immediate = True
    action: model.SetMonitorAction

    def update(self) -> Status:
        """Set the monitor."""
        self.context.set_monitor(self.action.monitor_ref, self.action.value)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe monitor and value."""
        return f"monitor {self.action.monitor_ref} is {str(self.action.value).lower()}"
