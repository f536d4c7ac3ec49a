"""States of the traffic signals of a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.errors import Diagnostic, ScenarioError, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import DEFAULT_LAMPS, YELLOW, lamp_colors, must_stop


class SignalCycle:
    """Cycle of one TrafficSignalController, and the ids of the signals that it controls."""

    def __init__(self, element: model.TrafficSignalController, signals: Iterable[str]) -> None:
        self.element = element
        self.name = element.name
        self.phases = element.phase
        self.signals = tuple(signals)
        self.leader: SignalCycle | None = None
        self.total = math.fsum(phase.duration for phase in self.phases)
        """Duration of the cycle [s], infinite if a phase has no end."""
        self._selected = 0, element.delay or 0.0
        """Number of the phase that an action has set, at first 0, and its start after that of the leader [s]."""

    @property
    def first_start(self) -> float:
        """(Virtual) start time of the first phase [s]; phases without end count as 0 s before others."""
        number, time = self._anchor()
        return time - math.fsum(phase.duration for phase in self.phases[:number] if math.isfinite(phase.duration))

    def set_phase(self, name: str, time: float) -> None:
        """Start the first phase of this name at `time` [s]. Raise ValueError if there is none."""
        self._selected = [phase.name for phase in self.phases].index(name), time - self._leader_start()

    def phase_at(self, time: float) -> int | None:
        """Return the number of the active phase at `time` [s]; None before a cycle without end starts."""
        number, started = self._anchor()
        elapsed = time - started
        if math.isfinite(self.total):
            elapsed = elapsed % self.total if self.total > 0.0 else 0.0
            if self.total - elapsed < EPSILON:
                elapsed = 0.0
        elif elapsed < -EPSILON:
            return None
        for _ in self.phases:
            duration = self.phases[number].duration
            if elapsed < duration - EPSILON:
                return number
            elapsed -= duration
            number = (number + 1) % len(self.phases)
        return number if self.phases else None

    def _anchor(self) -> tuple[int, float]:
        """Return the number of a phase and its start time [s]."""
        number, behind = self._selected
        return number, self._leader_start() + behind

    def _leader_start(self) -> float:
        """Return the start of the first phase of the leader [s]; 0 without a leader."""
        return 0.0 if self.leader is None else self.leader.first_start


def signal_cycles(
    declared: Iterable[model.TrafficSignalController], roads: RoadNetwork | None
) -> Mapping[str, SignalCycle]:
    """Return the cycles of the declared controllers by name, with their references."""
    cycles = {element.name: SignalCycle(element, _group(element.name, roads)) for element in declared}
    for cycle in cycles.values():
        reference = cycle.element.reference
        cycle.leader = cycles.get(reference) if reference else None
    return cycles


def cycle_errors(cycles: Mapping[str, SignalCycle]) -> Iterator[Diagnostic]:
    """Yield errors in the declarations of controllers."""
    for cycle in cycles.values():
        if (cycle.element.delay or 0.0) < 0.0:
            yield _diagnostic(cycle, "negative delay", f"got {cycle.element.delay:g} s; expected at least 0 s")
        for phase in cycle.phases:
            if not phase.duration >= 0.0:
                hint = f"got {phase.duration:g} s; expected at least 0 s, or INF"
                yield _diagnostic(cycle, f"phase {phase.name!r} has an invalid duration", hint, phase)
        if cycle in _leaders(cycle):
            yield _diagnostic(cycle, "reference to itself, directly or through other controllers", "remove a reference")


def cycle_warnings(cycles: Mapping[str, SignalCycle]) -> Iterator[Diagnostic]:
    """Yield warnings of declarations that the standard does not allow, but whose meaning is clear."""
    for cycle in cycles.values():
        leader, reference = cycle.leader, cycle.element.reference
        if not reference:
            if cycle.element.delay:
                message = "the delay without a reference counts from the start of the run"
                yield _diagnostic(cycle, message, "name a controller in `reference`")
        elif leader is None:
            message = f"the delay counts from the start of the run, as {reference!r} has no phases"
            yield _diagnostic(cycle, message, suggestion(reference, cycles))
        elif cycle.element.delay is None:
            message = f"reference to {reference!r} without a delay: both run synchronously"
            yield _diagnostic(cycle, message, 'write delay="0"')
        elif leader.total != cycle.total:
            message = f"cycle of {cycle.total:g} s, but {leader.total:g} s of its reference {reference!r}"
            yield _diagnostic(cycle, message, "a delay requires cycles of equal duration")


def _leaders(cycle: SignalCycle) -> list[SignalCycle]:
    """Return the controllers that a controller refers to, directly or through others."""
    leaders: list[SignalCycle] = []
    at = cycle.leader
    while at is not None and at not in leaders:
        leaders.append(at)
        at = at.leader
    return leaders


def _group(name: str, roads: RoadNetwork | None) -> tuple[str, ...]:
    """Return the signals of the controller of the road network with this id, otherwise with this name."""
    if roads is None:
        return ()
    named = [entry for entry in roads.controllers.values() if entry.name == name]
    controller = roads.controllers.get(name) or next(iter(named), None)
    return controller.signals if controller is not None else ()


def _diagnostic(cycle: SignalCycle, message: str, hint: str, at: model.Element | None = None) -> Diagnostic:
    where = at or cycle.element
    return Diagnostic.at(where, f"TrafficSignalController {cycle.name!r}: {message}", hint)


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
        return Diagnostic.at(element, message, hint)

    def check_phase(self, controller: str, phase: str, element: model.Element) -> None:
        """Raise ScenarioError if the phases of a signal controller are declared without this one."""
        cycle = self.cycles.get(controller)
        phases = [phase] if cycle is None else [entry.name for entry in cycle.phases]
        if phase not in phases:
            message = f"{type(element).__name__}: signal controller {controller!r} has no phase {phase!r}"
            raise ScenarioError(Diagnostic.at(element, message, suggestion(phase, phases)))

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
        return states | {self.identify(entry.traffic_signal_id): entry.state for entry in phase.traffic_signal_state}

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
        distance, nearest = min(near, default=(math.inf, ""))
        return nearest if distance <= SAME_PLACE else None
