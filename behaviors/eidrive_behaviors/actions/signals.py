"""Actions on traffic signals: state of a signal, phase of a signal controller."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class TrafficSignalStateAction(ActionBehaviour):
    """State of one signal until the next phase of its controller starts. The signal type interprets the text.

    Its name is the signal id in the road network, or `id=…` or `pos=x,y` as in ScenarioRunner.
    """

    immediate = True
    action: model.TrafficSignalStateAction

    def configure(self) -> None:
        """Warn of an unknown signal."""
        warning = self.context.signals.unknown(self.action.name, self.action)
        if warning is not None:
            self.context.warn(warning)

    def update(self) -> Status:
        """Set the state."""
        self.context.set_signal_state(self.action.name, self.action.state)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe signal and state."""
        return f"signal {self.action.name} shows {self.action.state}"


class TrafficSignalControllerAction(ActionBehaviour):
    """Immediate start of a phase of a signal controller.

    Its cycle continues from there, and so do the cycles of controllers that refer to it.
    """

    immediate = True
    action: model.TrafficSignalControllerAction

    def configure(self) -> None:
        """Check the phase. Raise ScenarioError if the controller does not have it."""
        self.context.signals.check_phase(self.action.traffic_signal_controller_ref, self.action.phase, self.action)

    def update(self) -> Status:
        """Start the phase."""
        self.context.set_signal_phase(self.action.traffic_signal_controller_ref, self.action.phase)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe controller and phase."""
        return f"signal controller {self.action.traffic_signal_controller_ref} goes to {self.action.phase}"
