"""States of the traffic signals of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from eidrive_scenario.errors import Diagnostic, ScenarioError, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import DEFAULT_LAMPS, YELLOW, lamp_colors, must_stop
from eidrive_scenario.storyboard.state.signal_cycles import SignalCycle, cycle_errors, cycle_warnings, signal_cycles

SEMANTICS = {
    model.TrafficSignalSemantics.STOP: "red",
    model.TrafficSignalSemantics.ATTENTION_GO: "red;yellow",
    model.TrafficSignalSemantics.GO: "green",
    model.TrafficSignalSemantics.ATTENTION_STOP: "yellow",
    model.TrafficSignalSemantics.CAUTION: "flashing yellow",
    model.TrafficSignalSemantics.FALLBACK: "off",
}
"""State of the signals in a phase of OpenSCENARIO 1.4 that states their meaning alone."""
WITHOUT_YELLOW = {**SEMANTICS, model.TrafficSignalSemantics.ATTENTION_STOP: "red"}
"""The same for signals without a yellow lamp: both yellow and red mean stop."""
SAME_PLACE = 2.0
"""Maximum distance between a signal and the point of ScenarioRunner's `pos=x,y` [m]."""


class Signals:
    """Traffic signals of a run. A signal has no state until an action or a phase sets it.

    cycles    cycles of the signal controllers, by name
    errors    errors in the declarations of controllers
    warnings  warnings of these declarations
    """

    def __init__(self, declared: model.TrafficSignals | None, roads: RoadNetwork | None) -> None:
        self._roads = roads
        self._colors: Mapping[str, tuple[str, ...]] = {
            signal.id: lamp_colors(signal) for signal in (roads.signals.values() if roads is not None else ())
        }
        controllers = declared.traffic_signal_controller if declared is not None else ()
        self.cycles: Mapping[str, SignalCycle] = signal_cycles(controllers, roads)
        self.errors = tuple(cycle_errors(self.cycles))
        self.warnings = () if self.errors else tuple(cycle_warnings(self.cycles))
        self._states: dict[str, str] = {}
        self._running: dict[str, int | None] = {}
        self._ids: dict[str, str] = {}
        self.states: Mapping[str, str] = MappingProxyType(self._states)
        """State of each signal by id: the same object until a state changes."""

    def state(self, name: str) -> str | None:
        """Return the state of a signal; None before it is set."""
        return self._states.get(self.identify(name))

    def must_stop(self, name: str) -> bool:
        """Whether the state of a signal requires vehicles to stop."""
        state = self.state(name)
        return state is not None and must_stop(state, self._colors.get(name) or DEFAULT_LAMPS)

    def set_state(self, name: str, state: str) -> None:
        """Set the state of a signal; the next phase of its controller or another action replaces it."""
        self._set_states({self.identify(name): state})

    def phase(self, controller: str) -> str | None:
        """Return the name of the active phase of a controller; None without one."""
        number = self._running.get(controller)
        return None if number is None else self.cycles[controller].phases[number].name

    def set_phase(self, controller: str, phase: str, time: float) -> None:
        """Start a phase of a controller at `time` [s]; its cycle continues from this phase."""
        self.cycles[controller].set_phase(phase, time)
        self._running.pop(controller, None)
        self.advance(time)

    def advance(self, time: float) -> None:
        """Activate the phases of this time [s]. A phase sets the states of its signals when it starts."""
        for name, cycle in self.cycles.items():
            number = cycle.phase_at(time)
            if name not in self._running or self._running[name] != number:
                self._running[name] = number
                if number is not None:
                    self._set_states(self._phase_states(cycle, cycle.phases[number]))

    def identify(self, name: str) -> str:
        """Return the id of the signal with this name: an id, or ScenarioRunner's `id=…` or `pos=x,y`."""
        if name not in self._ids:
            self._ids[name] = self._resolve_name(name)
        return self._ids[name]

    def unknown(self, name: str, element: model.Element) -> Diagnostic | None:
        """Return a warning if the road network has no signal of this name; its state is stored nevertheless."""
        if self.identify(name) in self._colors:
            return None
        hint = suggestion(name, self._colors) if self._colors else "the road network has no signals"
        message = f"{type(element).__name__}: the road network has no signal {name!r}; its state has no effect"
        return Diagnostic(message, hint, element.source, element.line)

    def check_phase(self, controller: str, phase: str, element: model.Element) -> None:
        """Raise ScenarioError if the phases of a signal controller are declared without this one."""
        cycle = self.cycles.get(controller)
        known = [phase] if cycle is None else [one.name for one in cycle.phases]
        if phase not in known:
            message = f"{type(element).__name__}: signal controller {controller!r} has no phase {phase!r}"
            raise ScenarioError(Diagnostic(message, suggestion(phase, known), element.source, element.line))

    def _phase_states(self, cycle: SignalCycle, phase: model.Phase) -> dict[str, str]:
        """Return the states of a phase by signal. A group state holds for each signal of the group.

        Without signals it holds for the name of the controller. The semantics of a phase without states determine the
        state of the group.
        """
        group = phase.traffic_signal_group_state or phase.traffice_signal_group_state
        signals = cycle.signals or (cycle.name,)
        states: dict[str, str] = {}
        if group is not None:
            states = dict.fromkeys(signals, group.state)
        elif phase.semantics is not None and not phase.traffic_signal_state:
            for name in signals:
                has_yellow = YELLOW in (self._colors.get(name) or DEFAULT_LAMPS)
                states[name] = (SEMANTICS if has_yellow else WITHOUT_YELLOW)[phase.semantics]
        return states | {self.identify(one.traffic_signal_id): one.state for one in phase.traffic_signal_state}

    def _set_states(self, states: Mapping[str, str]) -> None:
        if any(self._states.get(name) != state for name, state in states.items()):
            self._states = {**self._states, **states}
            self.states = MappingProxyType(self._states)

    def _resolve_name(self, name: str) -> str:
        spelling, _, rest = name.partition("=")
        match spelling.strip().lower():
            case "id" if rest.strip():
                return rest.strip()
            case "pos" if rest.strip():
                return self._nearest_signal(rest) or name
        return name

    def _nearest_signal(self, text: str) -> str | None:
        """Return the id of the nearest signal to a point in CARLA's left-handed coordinates (y to the right)."""
        try:
            x, y = (float(part) for part in text.split(",")[:2])
        except ValueError:
            return None
        if self._roads is None:
            return None
        near = []
        for signal in self._roads.signals.values():
            for place in (signal.place, *signal.references):
                pose = self._roads.signal_pose(signal, place)
                near.append((math.hypot(pose.x - x, pose.y + y), signal.id))
        distance, found = min(near, default=(math.inf, ""))
        return found if distance <= SAME_PLACE else None
