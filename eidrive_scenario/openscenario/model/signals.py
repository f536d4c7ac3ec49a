"""Traffic signals: controllers with phases, actions and conditions."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.declarations import SignalControllerName
from eidrive_scenario.openscenario.model.element import ALL, Choice, Element, attribute, child, element_type
from eidrive_scenario.openscenario.model.enumerations import TrafficSignalSemantics


@element_type
class TrafficSignalState(Element):
    """State of one signal."""

    state: str
    traffic_signal_id: str


@element_type
class TrafficSignalGroupState(Element):
    """State of all signals of a controller."""

    state: str


@element_type
class Phase(Element):
    """Phase of a controller; duration [s]."""

    duration: float
    name: str
    semantics: TrafficSignalSemantics | None = attribute(since="1.4")
    traffic_signal_state: tuple[TrafficSignalState, ...] = ()
    traffice_signal_group_state: TrafficSignalGroupState | None = child(since="1.2", until="1.2")
    traffic_signal_group_state: TrafficSignalGroupState | None = child(since="1.3")


@element_type
class TrafficSignalController(Element):
    """Controller of signals; delay after the referenced controller [s]."""

    name: str
    delay: float | None = None
    reference: str | None = None
    phase: tuple[Phase, ...] = ()


@element_type
class TrafficSignals(Element):
    """Signal controllers of a scenario."""

    traffic_signal_controller: tuple[TrafficSignalController, ...] = ()


@element_type
class TrafficSignalStateAction(Element):
    """Action that sets the state of a signal."""

    name: str
    state: str


@element_type
class TrafficSignalControllerAction(Element):
    """Action that sets the phase of a controller."""

    traffic_signal_controller_ref: SignalControllerName
    phase: str


@element_type
class TrafficSignalAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets a signal or a controller."""

    traffic_signal_controller_action: TrafficSignalControllerAction | None = None
    traffic_signal_state_action: TrafficSignalStateAction | None = None


@element_type
class InfrastructureAction(Element, content=ALL):
    """Action of the infrastructure."""

    traffic_signal_action: TrafficSignalAction


@element_type
class TrafficSignalCondition(Element):
    """Condition on the state of a signal."""

    name: str
    state: str


@element_type
class TrafficSignalControllerCondition(Element):
    """Condition on the phase of a controller."""

    traffic_signal_controller_ref: SignalControllerName
    phase: str
