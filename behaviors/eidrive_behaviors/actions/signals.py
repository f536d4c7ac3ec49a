"""TrafficSignalStateAction: set a signal."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, model


class TrafficSignalStateAction(ActionBehaviour):
    """Sets the state of one signal; the text means what the signal's type makes of it."""

    immediate = True
    action: model.TrafficSignalStateAction

    def update(self) -> Status:
        """Set it."""
        self.stage.signals[self.action.name] = self.action.state
        self.stage.commands.signals[self.action.name] = self.action.state
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"signal {self.action.name} shows {self.action.state}"
