"""The controllers of traffic signals: phases that follow each other, again and again.

A cycle is a function of time: the controller knows when its first phase (virtually) began. So one that refers to
another is `delay` seconds behind it from the very start of the run, and stays so when an action shifts the other one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from eidrive_scenario.errors import Diagnostic, suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.tolerances import EPSILON


class SignalCycle:
    """One TrafficSignalController of the scenario, and the ids of the signals that it switches together."""

    def __init__(self, element: model.TrafficSignalController, signals: Iterable[str]) -> None:
        self.element = element
        self.name = element.name
        self.phases = element.phase
        self.signals = tuple(signals)
        self.leader: SignalCycle | None = None
        self.total = math.fsum(phase.duration for phase in self.phases)
        """Length of the cycle [s], infinite where a phase has no end."""
        self._set: tuple[int, float] | None = None
        """The phase that an action chose, and when."""

    @property
    def first_begun(self) -> float:
        """When its first phase began, perhaps virtually [s]; phases without end count as 0 s before others."""
        number, time = self._anchor()
        return time - math.fsum(phase.duration for phase in self.phases[:number] if math.isfinite(phase.duration))

    def set_phase(self, name: str, time: float) -> None:
        """Let the first phase of this name begin now. Raises ValueError if there is none."""
        self._set = ([phase.name for phase in self.phases].index(name), time)

    def phase_at(self, time: float) -> int | None:
        """The number of the phase that runs at `time` [s]; None before a cycle without end has begun."""
        number, begun = self._anchor()
        elapsed = time - begun
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
        """A phase and when it began."""
        if self._set is not None:
            return self._set
        behind = self.element.delay or 0.0
        return 0, behind if self.leader is None else self.leader.first_begun + behind


def signal_cycles(
    declared: Iterable[model.TrafficSignalController], roads: RoadNetwork | None
) -> Mapping[str, SignalCycle]:
    """The controllers by name, connected with each other."""
    cycles = {element.name: SignalCycle(element, _group(element.name, roads)) for element in declared}
    for cycle in cycles.values():
        reference = cycle.element.reference
        cycle.leader = cycles.get(reference) if reference else None
    return cycles


def cycle_errors(cycles: Mapping[str, SignalCycle]) -> Iterator[Diagnostic]:
    """What makes no sense in the declarations."""
    for cycle in cycles.values():
        if (cycle.element.delay or 0.0) < 0.0:
            yield _diagnostic(
                cycle, f"has a delay of {cycle.element.delay:g} s", "give a number of seconds, at least 0"
            )
        for phase in cycle.phases:
            if not phase.duration >= 0.0:
                hint = "give a number of seconds, at least 0, or INF"
                yield _diagnostic(cycle, f"has a phase of {phase.duration:g} s", hint, phase)
        if cycle in _leaders(cycle):
            yield _diagnostic(cycle, "is its own reference, directly or over others", "take a reference out")


def cycle_warnings(cycles: Mapping[str, SignalCycle]) -> Iterator[Diagnostic]:
    """What the standard does not allow in the declarations, and yet can be understood."""
    for cycle in cycles.values():
        leader, reference = cycle.leader, cycle.element.reference
        if not reference:
            if cycle.element.delay:
                message = "has a delay to no controller: it counts from the start"
                yield _diagnostic(cycle, message, "name a controller in `reference`")
        elif leader is None:
            message = f"refers to {reference!r}, which has no phases here: its delay counts from the start"
            yield _diagnostic(cycle, message, suggestion(reference, cycles))
        elif cycle.element.delay is None:
            message = f"refers to {reference!r} without a delay: they go together"
            yield _diagnostic(cycle, message, 'write delay="0"')
        elif leader.total != cycle.total:
            message = f"takes {cycle.total:g} s for its phases, its reference {reference!r} {leader.total:g} s"
            yield _diagnostic(cycle, message, "a delay makes sense between cycles of one length")


def _leaders(cycle: SignalCycle) -> list[SignalCycle]:
    """Those that a controller refers to, over others too."""
    found: list[SignalCycle] = []
    at = cycle.leader
    while at is not None and at not in found:
        found.append(at)
        at = at.leader
    return found


def _group(name: str, roads: RoadNetwork | None) -> tuple[str, ...]:
    """The signals of the road network's controller with this id, or else with this name."""
    if roads is None:
        return ()
    named = [entry for entry in roads.controllers.values() if entry.name == name]
    found = roads.controllers.get(name) or next(iter(named), None)
    return found.signals if found is not None else ()


def _diagnostic(cycle: SignalCycle, message: str, hint: str, at: model.Element | None = None) -> Diagnostic:
    where = at or cycle.element
    return Diagnostic(f"TrafficSignalController {cycle.name!r} {message}", hint, where.source, where.line)
