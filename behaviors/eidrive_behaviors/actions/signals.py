"""Actions on traffic signals: set one, or the phase of a controller."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, Stage, model, suggestion


class TrafficSignalStateAction(ActionBehaviour):
    """Sets the state of one signal, until its controller's next phase begins; the text means what its type makes of it.

    Its name is the signal's id in the road network, or ScenarioRunner's `id=…` and `pos=x,y`.
    """

    immediate = True
    action: model.TrafficSignalStateAction

    def __init__(
        self,
        action: model.TrafficSignalStateAction,
        stage: Stage,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, stage, actor=actor, parent=parent)
        odd = stage.signals.unknown(action.name, action)
        if odd is not None:
            stage.warnings.append(odd)

    def update(self) -> Status:
        """Set it."""
        self.stage.signals.set_state(self.action.name, self.action.state)
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
        stage: Stage,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, stage, actor=actor, parent=parent)
        cycle = stage.signals.cycles.get(action.traffic_signal_controller_ref)
        phases = [phase.name for phase in cycle.phases] if cycle is not None else [action.phase]
        if action.phase not in phases:
            raise self.problem(
                f"asks {action.traffic_signal_controller_ref!r} for a phase {action.phase!r}, which it does not have",
                suggestion(action.phase, phases),
            )

    def update(self) -> Status:
        """Begin it."""
        self.stage.signals.set_phase(
            self.action.traffic_signal_controller_ref, self.action.phase, max(self.stage.time, 0.0)
        )
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"signal controller {self.action.traffic_signal_controller_ref} goes to {self.action.phase}"
