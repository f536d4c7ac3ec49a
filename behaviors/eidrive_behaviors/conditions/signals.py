"""Conditions on traffic signals and their controllers."""

from __future__ import annotations

from eidrive_scenario.api.actions import Condition, RuntimeContext, model
from eidrive_scenario.api.common import Diagnostic, ScenarioError, suggestion


class TrafficSignalCondition(Condition):
    """A signal shows a state: the same text, whatever its case, as no tool's states differ in that alone."""

    instant = True
    element: model.TrafficSignalCondition

    def bind(self, context: RuntimeContext) -> None:
        """Say what is odd about the signal's name."""
        odd = context.signals.unknown(self.element.name, self.element)
        if odd is not None:
            context.warnings.append(odd)

    def holds(self, context: RuntimeContext) -> bool:
        """Compare its state."""
        state = context.signals.state(self.element.name)
        return state is not None and _plain(state) == _plain(self.element.state)

    def explain(self, context: RuntimeContext) -> str:
        """Its state."""
        return f"signal {self.element.name} shows {context.signals.state(self.element.name) or 'nothing'}"

    def describe(self) -> str:
        """The state."""
        return f"signal {self.element.name} shows {self.element.state}"


class TrafficSignalControllerCondition(Condition):
    """A controller is in a phase."""

    instant = True
    element: model.TrafficSignalControllerCondition

    def bind(self, context: RuntimeContext) -> None:
        """Look the phase up. Raises ScenarioError if the controller does not have it."""
        element = self.element
        cycle = context.signals.cycles.get(element.traffic_signal_controller_ref)
        phases = [phase.name for phase in cycle.phases] if cycle is not None else [element.phase]
        if element.phase not in phases:
            what = f"{element.traffic_signal_controller_ref!r} has no phase {element.phase!r}"
            raise ScenarioError(
                Diagnostic(
                    f"TrafficSignalControllerCondition can never hold: {what}",
                    suggestion(element.phase, phases),
                    element.source,
                    element.line,
                )
            )

    def holds(self, context: RuntimeContext) -> bool:
        """Compare its phase."""
        return context.signals.phase(self.element.traffic_signal_controller_ref) == self.element.phase

    def explain(self, context: RuntimeContext) -> str:
        """Its phase."""
        name = self.element.traffic_signal_controller_ref
        return f"signal controller {name} is in {context.signals.phase(name) or 'no phase'}"

    def describe(self) -> str:
        """The phase."""
        return f"signal controller {self.element.traffic_signal_controller_ref} is in {self.element.phase}"


def _plain(state: str) -> str:
    return state.strip().lower()
