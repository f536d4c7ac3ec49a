"""Stop lines of traffic lights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from eidrive_scenario.roads.model.location import LaneKey
from eidrive_scenario.roads.model.road_map import SignalPlace
from eidrive_scenario.traffic.cars import Cars
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.leaders import FIXED, Leaders, Occupants, find_leaders, no_occupants

STOP_LINE = 1.0
"""Distance of waiting cars from the stop line [m]."""
TOO_LATE = 4.0
"""Deceleration above which a car passes a light that has just changed [m/s²]."""
MustStop = Callable[[str], bool]
"""Whether the traffic light of this id requires a stop now."""


class StopLines:
    """Traffic lights of a map on the lanes for which they are valid.

    The stop line is at s of the light. For a light on a connecting road it is before the junction.
    """

    def __init__(self, lanes: TrafficLanes, must_stop: MustStop) -> None:
        self._lanes = lanes
        self._must_stop = must_stop
        self._signals: list[str] = []
        found: list[tuple[int, float, int]] = []
        for signal in lanes.roads.signals.values():
            if not signal.dynamic:
                continue
            for place in (signal.place, *signal.references):
                found += [(row, progress, len(self._signals)) for row, progress in self._on_lanes(place)]
            self._signals.append(signal.id)
        self._row = np.array([row for row, _, _ in found], dtype=np.int64)
        self._progress = np.array([progress for _, progress, _ in found])
        self._signal = np.array([signal for _, _, signal in found], dtype=np.int64)
        self._shown: tuple[bool, ...] = ()
        self._closed = no_occupants()

    def _on_lanes(self, place: SignalPlace) -> list[tuple[int, float]]:
        lanes = self._lanes
        road = lanes.roads.roads.get(place.road)
        if road is None:
            return []
        section = road.section_at(place.s)
        found = []
        for number in lanes.roads.signal_lanes(place):
            row = lanes.row[LaneKey(road.id, section.index, number)]
            progress = float(lanes.progress(np.array([row]), np.array([place.s]))[0])
            found.append((row, 0.0 if road.junction_id is not None else progress))
        return found

    def closed(self) -> Occupants:
        """Return the stop lines at which traffic has to stop now as occupants."""
        shown = tuple(self._must_stop(signal) for signal in self._signals)
        if shown != self._shown:
            self._shown = shown
            red = np.array(shown, dtype=bool)[self._signal]
            row, progress = self._row[red], self._progress[red]
            still = np.zeros(len(row))
            self._closed = Occupants(row, progress, progress, progress, still, np.full(len(row), FIXED))
        return self._closed

    def ahead(self, cars: Cars) -> Leaders:
        """Return the stop lines at which cars stop, without those that require too hard braking."""
        none = np.zeros(len(cars))
        lines = find_leaders(self._lanes, cars.plan, cars.progress + cars.front, none, self.closed())
        late = cars.speed**2 > 2.0 * TOO_LATE * np.maximum(lines.gap, 0.0)
        binding = (lines.gap >= 0.0) & ~late & ~cars.walks & ~cars.ignores_lights
        return Leaders(np.where(binding, np.maximum(lines.gap - STOP_LINE, 1e-3), np.inf), lines.speed)
