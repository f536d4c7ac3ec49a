"""Traffic signals: what each of them shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import DEFAULT_LAMPS, lamp_colors, must_stop
from eidrive_scenario.storyboard.state.signal_cycles import SignalCycle, cycle_errors, cycle_warnings, signal_cycles

SAME_PLACE = 2.0
"""ScenarioRunner's `pos=x,y` means the signal that is at most this far from the point [m]."""


class Signals:
    """All traffic signals of a run; one that nobody has set shows nothing.

    problems, warnings  what makes no sense in the declarations of controllers, and what is odd there
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
        self._spelled: dict[str, str] = {}
        self.states: Mapping[str, str] = MappingProxyType(self._states)
        """What each signal shows, by id: the same object until something changes."""

    def state(self, name: str) -> str | None:
        """What a signal shows; None if nobody has set it."""
        return self._states.get(self.identify(name))

    def must_stop(self, name: str) -> bool:
        """Whether a signal tells traffic to stop."""
        state = self.state(name)
        return state is not None and must_stop(state, self._colors.get(name) or DEFAULT_LAMPS)

    def set_state(self, name: str, state: str) -> None:
        """Let a signal show a state, until its controller's next phase begins or somebody sets it again."""
        self._show({self.identify(name): state})

    def phase(self, controller: str) -> str | None:
        """The name of the phase in which a controller is."""
        number = self._running.get(controller)
        return None if number is None else self.cycles[controller].phases[number].name

    def set_phase(self, controller: str, phase: str, time: float) -> None:
        """Let a phase of a controller begin now; its cycle goes on from there."""
        self.cycles[controller].set_phase(phase, time)
        self._running.pop(controller, None)
        self.advance(time)

    def advance(self, time: float) -> None:
        """Go over to the phases of this time [s]; what a phase sets, it sets when it begins."""
        for name, cycle in self.cycles.items():
            number = cycle.phase_at(time)
            if name not in self._running or self._running[name] != number:
                self._running[name] = number
                if number is not None:
                    self._show(self._shown_in(cycle, cycle.phases[number]))

    def identify(self, name: str) -> str:
        """The id of the signal that a name means: an id, or ScenarioRunner's `id=…` and `pos=x,y`."""
        if name not in self._spelled:
            self._spelled[name] = self._meant(name)
        return self._spelled[name]

    def unknown(self, name: str, element: model.Element) -> Diagnostic | None:
        """What is odd about the name of a signal; its state is kept by that name all the same."""
        if self.identify(name) in self._colors:
            return None
        hint = suggestion(name, self._colors) if self._colors else "the road network has no signals"
        message = f"the road network has no signal {name!r}: its state is kept, and nowhere to be seen"
        return Diagnostic(message, hint, element.source, element.line)

    def _shown_in(self, cycle: SignalCycle, phase: model.Phase) -> dict[str, str]:
        """A phase's states by signal; a group's is that of each of its signals, and of its own name without any."""
        group = phase.traffic_signal_group_state or phase.traffice_signal_group_state
        shown = dict.fromkeys(cycle.signals or (cycle.name,), group.state) if group is not None else {}
        return shown | {self.identify(one.traffic_signal_id): one.state for one in phase.traffic_signal_state}

    def _show(self, states: Mapping[str, str]) -> None:
        if any(self._states.get(name) != state for name, state in states.items()):
            self._states = {**self._states, **states}
            self.states = MappingProxyType(self._states)

    def _meant(self, name: str) -> str:
        spelling, _, rest = name.partition("=")
        match spelling.strip().lower():
            case "id" if rest.strip():
                return rest.strip()
            case "pos" if rest.strip():
                return self._at(rest) or name
        return name

    def _at(self, text: str) -> str | None:
        """The nearest signal to a place in CARLA's left-handed coordinates, whose y points to the right."""
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
