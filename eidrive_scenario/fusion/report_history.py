"""Processing of out-of-sequence reports by rollback and refiltering."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate, Table
from eidrive_scenario.fusion.tracks import TRACK, update_tracks


class _Entry(NamedTuple):
    """Report of one station, and a table with the tracks of the station after it."""

    report: Report
    tracks: Table


@dataclass
class _History:
    """Stored reports of one station; reports up to `begin` [s] are no longer accepted."""

    entries: list[_Entry] = field(default_factory=list)
    new: list[Report] = field(default_factory=list)
    begin: float = -math.inf


class ReportHistory:
    """Tracks of every station, and its reports of the last `span` seconds.

    An out-of-sequence report rolls the tracks of its station back to the last earlier report, and later reports are
    filtered again. The result equals that of reports in order of measurement. This is the exact solution for
    out-of-sequence measurements at the cost of memory (Bar-Shalom, Update with out-of-sequence measurements in
    tracking: exact solution, IEEE Transactions on Aerospace and Electronic Systems 38, 2002). Reports older than all
    stored ones are ignored. Of two reports with the same time the last received one is used.
    """

    def __init__(self, span: float, gate: AssociationGate) -> None:
        self.span = span
        self.stations: list[str | None] = []
        """Station names; rows of `tracks` refer to their index. Slots of evicted stations are None or reused."""
        self._gate = gate
        self._tracks: Table = np.zeros(0, TRACK)
        self._histories: list[_History] = []
        self._places: dict[str, int] = {}

    def add_report(self, report: Report) -> None:
        """Store a report. It is processed at the next call of `tracks`."""
        place = self._places.get(report.station)
        if place is None:
            place = self._places[report.station] = self._allocate_slot(report.station)
        self._histories[place].new.append(report)

    def evict_stale(self, now: float) -> None:
        """Evict stations whose last report is older than twice the retention time.

        Reports older than `span` [s] are not used, and no later report can continue a track that ended more than
        `span` earlier.
        """
        stale = [
            place
            for place in self._places.values()
            if not (history := self._histories[place]).new
            and (not history.entries or history.entries[-1].report.detections.time < now - 2.0 * self.span)
        ]
        for place in stale:
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
        """Return the tracks after all reports: one row per station and object, at the newest report of the station."""
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
        """Return the unprocessed reports of a station in order, after rollback of the tracks to the first of them."""
        latest = history.entries[-1].report.detections.time if history.entries else history.begin
        if len(history.new) == 1 and latest < history.new[0].detections.time < math.inf:
            return [history.new.pop()]
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
