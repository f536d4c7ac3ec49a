"""Actions on traffic signals: set one, or the phase of a controller."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, RuntimeContext, model
from eidrive_scenario.api.common import suggestion


class TrafficSignalStateAction(ActionBehaviour):
    """Sets the state of one signal, until its controller's next phase begins; the text means what its type makes of it.

    Its name is the signal's id in the road network, or ScenarioRunner's `id=…` and `pos=x,y`.
    """

    immediate = True
    action: model.TrafficSignalStateAction

    def __init__(
        self,
        action: model.TrafficSignalStateAction,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        odd = context.signals.unknown(action.name, action)
        if odd is not None:
            context.warnings.append(odd)

    def update(self) -> Status:
        """Set it."""
        self.context.signals.set_state(self.action.name, self.action.state)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"signal {self.action.name} shows {self.action.state}"


class TrafficSignalControllerAction(ActionBehaviour):
    """Lets a phase of a controller begin now; its cycle goes on from there, and so do those that refer to it."""

    immediate = True
    action: model.TrafficSignalControllerAction

    def __init__(
        self,
        action: model.TrafficSignalControllerAction,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        cycle = context.signals.cycles.get(action.traffic_signal_controller_ref)
        phases = [phase.name for phase in cycle.phases] if cycle is not None else [action.phase]
        if action.phase not in phases:
            raise self.error(
                f"asks {action.traffic_signal_controller_ref!r} for a phase {action.phase!r}, which it does not have",
                suggestion(action.phase, phases),
            )

    def update(self) -> Status:
        """Begin it."""
        self.context.signals.set_phase(
            self.action.traffic_signal_controller_ref, self.action.phase, max(self.context.time, 0.0)
        )
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"signal controller {self.action.traffic_signal_controller_ref} goes to {self.action.phase}"
