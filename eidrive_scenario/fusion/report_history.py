"""Processing of out-of-sequence reports by rollback and refiltering."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.fusion.pairs import AssociationGate, Table, ranges
from eidrive_scenario.fusion.tracks import TRACK, Rows, rows_of, update_tracks

_NO_ROWS = rows_of(np.zeros(0, TRACK))
_SPARE = 16
"""Minimum number of free rows of a table after it is enlarged."""


class _Entry(msgspec.Struct, frozen=True, gc=False):
    """Report of one station, and the tracks of the station after it: rows `start` to `end` of `rows`."""

    report: Report
    rows: Rows
    start: int
    end: int


@dataclass(slots=True)
class _History:
    """Stored reports of one station; reports up to `begin` [s] are no longer accepted."""

    entries: list[_Entry] = field(default_factory=list)
    new: list[Report] = field(default_factory=list)
    begin: float = -math.inf
    latest: float = -math.inf
    """Time of the last processed report [s]."""
    start: int = 0
    """First row of the tracks after the last processed report, in the table of the receiving station."""
    end: int = 0
    """Row after the last of these tracks."""

    def add_entry(self, report: Report, rows: Rows, start: int, end: int, span: float) -> None:
        """Store the tracks after a report, and delete reports that are older by more than `span` [s]."""
        entries, time = self.entries, report.detections.time
        entries.append(_Entry(report, rows, start, end))
        self.latest = time
        while len(entries) > 1 and entries[1].report.detections.time < time - span:
            del entries[0]
            self.begin = entries[0].report.detections.time


class ReportHistory:
    """Tracks of every station, and its reports of the last `span` seconds.

    An out-of-sequence report rolls the tracks of its station back to the last earlier report, and later reports are
    filtered again. The result equals that of reports in order of measurement. This is the exact solution for
    out-of-sequence measurements at the cost of memory (Bar-Shalom, Update with out-of-sequence measurements in
    tracking: exact solution, IEEE Transactions on Aerospace and Electronic Systems 38, 2002). Reports older than all
    stored ones are ignored. Of two reports with the same time the last received one is used; incomplete ones, as the
    segments of one CPM, are joined.
    """

    def __init__(self, span: float, gate: AssociationGate) -> None:
        self.span = span
        self._gate = gate
        self._histories: dict[str, _History] = {}
        self._updated: dict[str, _History] = {}
        """Histories with unprocessed reports."""
        self._next_eviction = math.inf
        """Time up to which no station is evicted [s]."""
        self._rows = _NO_ROWS
        """Table with the tracks of each station in consecutive rows; other rows are free."""
        self._used = 0
        """Number of rows up to the last one that may belong to a station."""
        self._order: tuple[str, ...] = ()
        self._selection: tuple[Integers, Integers] | None = None
        """Result of `select` for the stations in `_order`; None after a change of the rows."""

    def add_report(self, report: Report) -> None:
        """Store a report. It is processed at the next `process`."""
        history = self._histories.get(report.station)
        if history is None:
            history = self._histories[report.station] = _History()
            self._selection = None
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
                self._selection = None
        latest = min([history.latest for history in self._histories.values()], default=math.inf)
        self._next_eviction = latest + 2.0 * self.span

    def tracks(self, stations: tuple[str, ...]) -> Rows:
        """Return the tracks (N,) of these stations in this order.

        Each station has one row per object, at its newest processed report.
        """
        return self._rows.take(self.select(stations)[0])

    def select(self, stations: tuple[str, ...]) -> tuple[Integers, Integers]:
        """Return rows (N,) of the table with the tracks of these stations in this order, and the index of the station
        of each. They are valid until the next `process`."""
        if self._selection is None or stations != self._order:
            histories = self._histories
            present = [(rank, histories[station]) for rank, station in enumerate(stations) if station in histories]
            starts, ends = _ends_of([history for _, history in present])
            number, rows = ranges(starts, ends, np.arange(self._used))
            self._order, self._selection = stations, (rows, np.array([rank for rank, _ in present], np.int64)[number])
        return self._selection

    def positions(self, rows: Integers) -> Array:
        """Return the positions (N, 2) of rows (N,) of the table at the last reports [m]."""
        tracks: Table = self._rows.take(rows).view(TRACK)
        return np.asarray(tracks["mean"][:, :2])

    def copy_rows(self, rows: Integers, out: Rows) -> None:
        """Copy rows (N,) of the table to `out` (N,)."""
        self._rows.take(rows, out=out, mode="clip")  # the mode `raise` copies twice

    @staticmethod
    def process(histories: Sequence[ReportHistory]) -> None:
        """Process the new reports of several receiving stations with equal settings, as one batch.

        The result equals that of a separate call for each.
        """
        receivers: list[int] = []
        updated: list[_History] = []
        reports: list[Report] = []
        several: list[tuple[int, _History, Sequence[Report]]] = []
        for receiver, owner in enumerate(histories):
            oldest = math.inf
            for history in owner._updated.values():
                new = history.new
                if len(new) == 1 and history.latest < new[0].detections.time < math.inf:
                    receivers.append(receiver)
                    updated.append(history)
                    reports.append(new.pop())
                elif due := owner._due(history):
                    receivers.append(receiver)
                    updated.append(history)
                    reports.append(due[0])
                    if len(due) > 1:
                        several.append((receiver, history, due))
                if history.latest < oldest:
                    oldest = history.latest
            owner._next_eviction = min(owner._next_eviction, oldest + 2.0 * owner.span)
            owner._updated.clear()
        processed = 0
        while reports:
            _advance(histories, receivers, updated, reports)
            processed += 1
            several = [(receiver, history, due) for receiver, history, due in several if len(due) > processed]
            receivers = [receiver for receiver, _, _ in several]
            updated = [history for _, history, _ in several]
            reports = [due[processed] for _, _, due in several]

    def _due(self, history: _History) -> Sequence[Report]:
        """Return the unprocessed reports of a station in order, after rollback of its tracks to the first of them."""
        reports = [entry.report for entry in history.entries]
        kept = len(reports)
        for report in history.new:
            time = report.detections.time
            if not history.begin < time < math.inf:
                continue
            index = bisect_left(reports, time, key=lambda held: held.detections.time)
            again = index < len(reports) and reports[index].detections.time == time
            if again and not (report.complete or reports[index].complete):
                report = _joined(reports[index], report)
            reports[index : index + again] = [report]
            kept = min(kept, index)
        history.new.clear()
        if kept < len(history.entries):
            del history.entries[kept:]
            last = history.entries[-1] if history.entries else None
            history.latest = history.begin if last is None else last.report.detections.time
            self._store(history, _NO_ROWS if last is None else last.rows[last.start : last.end])
        return reports[kept:]

    def _store(self, history: _History, tracks: Rows) -> None:
        """Write the tracks of a station to the table, to other rows if their number has changed."""
        if history.end - history.start != len(tracks):
            history.start = history.end = 0
            self._selection = None
            if self._used + len(tracks) > len(self._rows):
                self._enlarge(len(tracks))
            history.start, history.end = self._used, self._used + len(tracks)
            self._used = history.end
        self._rows[history.start : history.end] = tracks

    def _enlarge(self, count: int) -> None:
        """Replace the table by one with at least `count` free rows, without free rows between those of stations."""
        histories = list(self._histories.values())
        starts, ends = _ends_of(histories)
        _, rows = ranges(starts, ends, np.arange(self._used))
        used = len(rows)
        table = np.zeros(2 * (used + count) + _SPARE, TRACK).view(_NO_ROWS.dtype)
        self.copy_rows(rows, table[:used])
        self._rows, self._used, self._selection = table, used, None
        end = 0
        for history in histories:
            start, end = end, end + history.end - history.start
            history.start, history.end = start, end


def _joined(first: Report, second: Report) -> Report:
    """Return the report with the objects of two incomplete ones of the same time; the second has precedence."""
    one, other = first.detections, second.detections
    if len(other) > len(other.tracks):  # without ids, objects of both reports cannot be told apart
        return second
    rest = one.subset([row for row, number in enumerate(one.tracks) if number not in other.tracks])
    detections = Detections.concatenate(other.time, [rest, other])
    return msgspec.structs.replace(second, detections=detections)


def _ends_of(histories: Sequence[_History]) -> tuple[Integers, Integers]:
    """Return the first row of the tracks of each station, and the one after the last."""
    starts = np.array([history.start for history in histories], np.int64)
    return starts, np.array([history.end for history in histories], np.int64)


def _advance(
    owners: Sequence[ReportHistory],
    receivers: Sequence[int],
    histories: Sequence[_History],
    reports: Sequence[Report],
) -> None:
    """Process one report of each station; `receivers` ascend."""
    starts, ends = _ends_of(histories)
    station, rows = ranges(starts, ends, np.arange(max(owner._used for owner in owners)))
    receiver = np.asarray(receivers)[station]
    limits = list(pairwise(np.searchsorted(receiver, np.arange(len(owners) + 1)).tolist()))
    tracks: Table = np.empty(len(rows), TRACK)
    for owner, (first, last) in zip(owners, limits, strict=True):
        if first < last:
            owner.copy_rows(rows[first:last], rows_of(tracks)[first:last])
    tracks["receiver"], tracks["station"] = receiver, station
    gate, span = owners[0]._gate, owners[0].span
    tracks = update_tracks(tracks, receivers, reports, gate, span)
    bounds = np.searchsorted(tracks["station"], np.arange(len(reports) + 1))
    after, start = rows_of(tracks), 0
    for history, report, end in zip(histories, reports, bounds[1:].tolist(), strict=True):
        history.add_entry(report, after, start, end, span)
        start = end
    same = np.diff(bounds) == ends - starts
    of_owner = pairwise(np.searchsorted(receivers, np.arange(len(owners) + 1)).tolist())
    for owner, (first, last), (begin, end) in zip(owners, limits, of_owner, strict=True):
        if same[begin:end].all():
            if begin < end:
                owner._rows[rows[first:last]] = after[bounds[begin] : bounds[end]]
            continue
        for index in range(begin, end):
            owner._store(histories[index], after[bounds[index] : bounds[index + 1]])
