"""Controllers of traffic signals: cyclic sequences of phases.

A cycle is a function of time: it is defined by the (virtual) start time of its first phase. A controller that refers to
another one is therefore `delay` seconds behind it from the start of the run, also after an action shifts the other one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.tolerances import EPSILON


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
        self._selected: tuple[int, float] | None = None
        """Number of the phase that an action has set, and the time of that [s]."""

    @property
    def first_start(self) -> float:
        """(Virtual) start time of the first phase [s]; phases without end count as 0 s before others."""
        number, time = self._anchor()
        return time - math.fsum(phase.duration for phase in self.phases[:number] if math.isfinite(phase.duration))

    def set_phase(self, name: str, time: float) -> None:
        """Start the first phase of this name at `time` [s]. Raise ValueError if there is none."""
        self._selected = ([phase.name for phase in self.phases].index(name), time)

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
        if self._selected is not None:
            return self._selected
        behind = self.element.delay or 0.0
        return 0, behind if self.leader is None else self.leader.first_start + behind


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
    found: list[SignalCycle] = []
    at = cycle.leader
    while at is not None and at not in found:
        found.append(at)
        at = at.leader
    return found


def _group(name: str, roads: RoadNetwork | None) -> tuple[str, ...]:
    """Return the signals of the controller of the road network with this id, otherwise with this name."""
    if roads is None:
        return ()
    named = [entry for entry in roads.controllers.values() if entry.name == name]
    found = roads.controllers.get(name) or next(iter(named), None)
    return found.signals if found is not None else ()


def _diagnostic(cycle: SignalCycle, message: str, hint: str, at: model.Element | None = None) -> Diagnostic:
    where = at or cycle.element
    return Diagnostic(f"TrafficSignalController {cycle.name!r}: {message}", hint, where.source, where.line)
