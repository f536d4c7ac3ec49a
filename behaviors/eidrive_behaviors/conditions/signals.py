"""Conditions on traffic signals and their controllers."""

from __future__ import annotations

from eidrive_scenario.api.actions import Condition, ConditionContext, model


class TrafficSignalCondition(Condition):
    """State of a signal, compared without case. No tool has states that differ in case only."""

    instant = True
    element: model.TrafficSignalCondition

    def bind(self, context: ConditionContext) -> None:
        """Warn of an unknown signal name."""
        warning = context.signals.unknown(self.element.name, self.element)
        if warning is not None:
            context.warn(warning)

    def holds(self, context: ConditionContext) -> bool:
        """Return True if the signal has the state."""
        state = context.signals.state(self.element.name)
        return state is not None and _normalized(state) == _normalized(self.element.state)

    def explain(self, context: ConditionContext) -> str:
        """Describe the current state."""
        return f"signal {self.element.name} shows {context.signals.state(self.element.name) or 'nothing'}"

    def describe(self) -> str:
        """Describe the required state."""
        return f"signal {self.element.name} shows {self.element.state}"


class TrafficSignalControllerCondition(Condition):
    """Phase of a signal controller."""

    instant = True
    element: model.TrafficSignalControllerCondition

    def bind(self, context: ConditionContext) -> None:
        """Check the phase. Raise ScenarioError if the controller does not have it."""
        context.signals.check_phase(self.element.traffic_signal_controller_ref, self.element.phase, self.element)

    def holds(self, context: ConditionContext) -> bool:
        """Return True if the controller is in the phase."""
        return context.signals.phase(self.element.traffic_signal_controller_ref) == self.element.phase

    def explain(self, context: ConditionContext) -> str:
        """Describe the current phase."""
        name = self.element.traffic_signal_controller_ref
        return f"signal controller {name} is in {context.signals.phase(name) or 'no phase'}"

    def describe(self) -> str:
        """Describe the required phase."""
        return f"signal controller {self.element.traffic_signal_controller_ref} is in {self.element.phase}"


def _normalized(state: str) -> str:
    return state.strip().lower()
