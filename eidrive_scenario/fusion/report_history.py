"""Processing of out-of-sequence reports by rollback and refiltering."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np

from eidrive_scenario.arrays import Integers
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate
from eidrive_scenario.fusion.tracks import TRACK, Rows, join_rows, rows_of, update_tracks

_NO_ROWS = rows_of(np.zeros(0, TRACK))


class _Entry(msgspec.Struct, frozen=True, gc=False):
    """Report of one station, and the tracks of the station after it."""

    report: Report
    rows: Rows


@dataclass(slots=True)
class _History:
    """Stored reports of one station; reports up to `begin` [s] are no longer accepted."""

    entries: list[_Entry] = field(default_factory=list)
    new: list[Report] = field(default_factory=list)
    begin: float = -math.inf
    latest: float = -math.inf
    """Time of the last processed report [s]."""
    rows: Rows = field(default_factory=lambda: _NO_ROWS)
    """Tracks of the station after the last processed report."""
    place: tuple[int, int] | None = None
    """First and last row of the tracks in the table of the receiving station; None outside the table."""

    def due(self) -> Sequence[Report]:
        """Return the unprocessed reports in order, after rollback of the tracks to the first of them."""
        if len(self.new) == 1 and self.latest < self.new[0].detections.time < math.inf:
            return [self.new.pop()]
        reports = [entry.report for entry in self.entries]
        kept = len(reports)
        for report in self.new:
            time = report.detections.time
            if not self.begin < time < math.inf:
                continue
            place = bisect_left(reports, time, key=lambda held: held.detections.time)
            again = place < len(reports) and reports[place].detections.time == time
            reports[place : place + again] = [report]
            kept = min(kept, place)
        self.new.clear()
        if kept < len(self.entries):
            del self.entries[kept:]
            last = self.entries[-1] if self.entries else None
            self.latest = self.begin if last is None else last.report.detections.time
            self.rows = _NO_ROWS if last is None else last.rows
        return reports[kept:]

    def add_entry(self, report: Report, rows: Rows, span: float) -> None:
        """Store the tracks after a report, and delete reports that are older by more than `span` [s]."""
        entries, time = self.entries, report.detections.time
        entries.append(_Entry(report, rows))
        self.latest, self.rows = time, rows
        while len(entries) > 1 and entries[1].report.detections.time < time - span:
            del entries[0]
            self.begin = entries[0].report.detections.time


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
        self._gate = gate
        self._histories: dict[str, _History] = {}
        self._updated: dict[str, _History] = {}
        """Histories with unprocessed reports."""
        self._next_eviction = math.inf
        """Time up to which no station is evicted [s]."""
        self._order: tuple[str, ...] = ()
        self._rows = _NO_ROWS
        self._ranks: Integers = np.zeros(0, np.int64)
        self._complete = False
        """Whether the table has the rows of all tracks of the stations in `_order`."""

    @property
    def stations(self) -> frozenset[str]:
        """Stations with stored reports."""
        return frozenset(self._histories)

    def add_report(self, report: Report) -> None:
        """Store a report. It is processed at the next `process`."""
        history = self._histories.get(report.station)
        if history is None:
            history = self._histories[report.station] = _History()
            self._complete = False
        history.new.append(report)
        self._updated[report.station] = history

    def evict_stale(self, now: float) -> None:
        """Evict stations whose last report is older than twice the retention time, after `process`.

        Reports older than `span` [s] are not used, and no later report can continue a track that ended more than
        `span` earlier.
        """
        if now <= self._next_eviction:
            return
        oldest = now - 2.0 * self.span
        for station, history in list(self._histories.items()):
            if history.latest < oldest:
                del self._histories[station]
                self._complete = False
        latest = min([history.latest for history in self._histories.values()], default=math.inf)
        self._next_eviction = latest + 2.0 * self.span

    def tracks(self, stations: tuple[str, ...]) -> tuple[Rows, Integers]:
        """Return the tracks of these stations in this order, and the index of the station of each (N,).

        Each station has one row per object, at its newest processed report. The rows are valid until the next
        `process`.
        """
        if not self._complete or stations != self._order:
            self._arrange(stations)
        return self._rows, self._ranks

    def _arrange(self, stations: tuple[str, ...]) -> None:
        """Build the table of these stations."""
        for history in self._histories.values():
            history.place = None
        present = [
            (rank, self._histories[station]) for rank, station in enumerate(stations) if station in self._histories
        ]
        start = 0
        for _, history in present:
            end = start + len(history.rows)
            history.place, start = (start, end), end
        self._order, self._complete = stations, True
        self._rows = np.concatenate([_NO_ROWS, *[history.rows for _, history in present]])
        self._ranks = np.repeat([rank for rank, _ in present], [len(history.rows) for _, history in present])

    def _refresh(self, history: _History) -> None:
        """Write the tracks of a station to the table, which is incomplete if their number changed."""
        if history.place is None or not self._complete:
            return
        start, end = history.place
        if len(history.rows) == end - start:
            self._rows[start:end] = history.rows
        else:
            self._complete = False

    @staticmethod
    def process(histories: Sequence[ReportHistory]) -> None:
        """Process the new reports of several receiving stations with equal settings, as one batch.

        The result equals that of a separate call for each.
        """
        due: list[tuple[int, _History, Sequence[Report]]] = []
        for receiver, owner in enumerate(histories):
            for history in owner._updated.values():
                if reports := history.due():
                    due.append((receiver, history, reports))
                owner._next_eviction = min(owner._next_eviction, history.latest + 2.0 * owner.span)
            owner._updated.clear()
        changed = due
        while due:
            first = histories[0]
            _advance(
                [receiver for receiver, _, _ in due],
                [history for _, history, _ in due],
                [reports[0] for _, _, reports in due],
                first._gate,
                first.span,
            )
            due = [(receiver, history, reports[1:]) for receiver, history, reports in due if len(reports) > 1]
        for receiver, history, _ in changed:
            histories[receiver]._refresh(history)


def _advance(
    receivers: Sequence[int],
    histories: Sequence[_History],
    reports: Sequence[Report],
    gate: AssociationGate,
    span: float,
) -> None:
    """Process one report of each station."""
    before = [history.rows for history in histories]
    tracks = join_rows(before)
    counts = [len(rows) for rows in before]
    tracks["receiver"] = np.repeat(receivers, counts)
    tracks["station"] = np.repeat(np.arange(len(reports)), counts)
    tracks = update_tracks(tracks, receivers, reports, gate, span)
    ends = np.searchsorted(tracks["station"], np.arange(len(reports)), "right").tolist()
    rows, start = rows_of(tracks), 0
    for history, report, end in zip(histories, reports, ends, strict=True):
        history.add_entry(report, rows[start:end], span)
        start = end
