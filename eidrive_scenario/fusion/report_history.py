"""Reports in the order in which they were measured, however late they arrive: roll back, and filter again."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate
from eidrive_scenario.fusion.tracks import TRACK, Table, update_tracks


class _Entry(NamedTuple):
    """A report of one station, and a table that holds the station's tracks just after it."""

    report: Report
    tracks: Table


@dataclass
class _History:
    """What is remembered of one station; nothing before `begin` [s], and that not any more."""

    entries: list[_Entry] = field(default_factory=list)
    new: list[Report] = field(default_factory=list)
    begin: float = -math.inf


class ReportHistory:
    """The tracks of every station as its reports make them, and the reports of the last `span` seconds.

    A report older than another of its station rolls the station's tracks back to the last report before it, and takes
    in anew what came after: the result is that of reports which arrive in the order of their measurement. This is the
    exact treatment of out-of-sequence measurements, paid for with memory (Bar-Shalom, Update with out-of-sequence
    measurements in tracking: exact solution, IEEE Transactions on Aerospace and Electronic Systems 38, 2002). One that
    is older than all that is remembered comes too late. Of two of one instant the one that arrives last counts.
    """

    def __init__(self, span: float, gate: AssociationGate) -> None:
        self.span = span
        self.stations: list[str | None] = []
        """Rows of `tracks` name a station by its place here; places of those who are forgotten are None, or reused."""
        self._gate = gate
        self._tracks: Table = np.zeros(0, TRACK)
        self._histories: list[_History] = []
        self._places: dict[str, int] = {}

    def add_report(self, report: Report) -> None:
        """Remember a report; it enters the tracks when they are next asked for."""
        place = self._places.get(report.station)
        if place is None:
            place = self._places[report.station] = self._allocate_slot(report.station)
        self._histories[place].new.append(report)

    def evict_stale(self, now: float) -> None:
        """Drop the stations that have been silent for so long that nothing of what is known of them can count again.

        What is older than `span` is not used, and no newer report can continue a track that ended `span` before it.
        """
        silent = [
            place
            for place in self._places.values()
            if not (history := self._histories[place]).new
            and (not history.entries or history.entries[-1].report.detections.time < now - 2.0 * self.span)
        ]
        for place in silent:
            name = self.stations[place]
            assert name is not None
            del self._places[name]
            self.stations[place], self._histories[place] = None, _History()
            self._tracks = self._tracks[self._tracks["station"] != place]

    def _allocate_slot(self, station: str) -> int:
        if None in self.stations:
            place = self.stations.index(None)
            self.stations[place] = station
            return place
        self.stations.append(station)
        self._histories.append(_History())
        return len(self.stations) - 1

    def tracks(self) -> Table:
        """What all reports so far say, a row for each object of each station, as of its station's newest report."""
        due = {
            station: reports
            for station, history in enumerate(self._histories)
            if history.new and (reports := self._due(station, history))
        }
        while due:
            self._advance(list(due), [reports[0] for reports in due.values()])
            due = {station: reports[1:] for station, reports in due.items() if len(reports) > 1}
        return self._tracks

    def _due(self, station: int, history: _History) -> Sequence[Report]:
        """The reports that have yet to enter the tracks of a station, in order; what came after them is rolled back."""
        reports = [entry.report for entry in history.entries]
        kept = len(reports)
        for report in history.new:
            time = report.detections.time
            if not history.begin < time < math.inf:
                continue
            place = bisect_left(reports, time, key=lambda held: held.detections.time)
            again = place < len(reports) and reports[place].detections.time == time
            reports[place : place + again] = [report]
            kept = min(kept, place)
        history.new.clear()
        if kept < len(history.entries):
            before = history.entries[kept - 1].tracks if kept else self._tracks[:0]
            others = self._tracks[self._tracks["station"] != station]
            self._tracks = np.concatenate([others, before[before["station"] == station]])
            del history.entries[kept:]
        return reports[kept:]

    def _advance(self, stations: list[int], reports: list[Report]) -> None:
        self._tracks = update_tracks(self._tracks, stations, reports, self._gate, self.span)
        for station, report in zip(stations, reports, strict=True):
            history = self._histories[station]
            history.entries.append(_Entry(report, self._tracks))
            while (
                len(history.entries) > 1
                and history.entries[1].report.detections.time < report.detections.time - self.span
            ):
                del history.entries[0]
                history.begin = history.entries[0].report.detections.time
