"""Reception log: batch processing is equivalent to processing by message."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.statistics import reception_log
from eidrive_scenario.v2x.statistics.reception_log import Entry, ReceptionLog

NAMES = ("A", "B", "C")
NOW = 45.0
"""Time after the last arrival [s]."""
SHORTEST, LONGEST = 0.02, 12.0
"""Range of all ages [s]."""


def entries(count: int) -> list[tuple[str, Entry]]:
    """Return messages with random delays, many of them out of sequence, in order of arrival."""
    rng = generator(1, "hearings")
    log_entries = []
    for number in range(count):
        sent = 0.1 * number
        arrives = sent + float(rng.uniform(SHORTEST, 1.5))
        sender, receiver = rng.choice(NAMES, 2, replace=False).tolist()
        message = Message(sender, number, sent, StationState(sent, 0, 0, 0, 0, 0), Detections(sent), 100)
        log_entries.append((receiver, (arrives, sender, number, sent, ReceivedMessage(message, arrives))))
    return sorted(log_entries, key=lambda entry: entry[1][0])


@pytest.mark.parametrize("pending", [0, 1, 7, 10**6])
def test_reception_statistics_are_independent_of_the_batch_size(monkeypatch: pytest.MonkeyPatch, pending: int) -> None:
    monkeypatch.setattr(reception_log, "MAX_PENDING", pending)
    log = ReceptionLog()
    for receiver, entry in entries(400):
        log.record(receiver, [entry])
        if entry[2] % 50 == 0:
            log.statistics_by_link(entry[0])
    statistics = log.statistics_by_link(NOW)
    assert set(statistics) == {(a, b) for a in NAMES for b in NAMES if a != b}
    for (sender, receiver), link in statistics.items():
        own = [entry for name, entry in entries(400) if (name, entry[1]) == (receiver, sender)]
        delays = [arrives - sent for arrives, _, _, sent, _ in own]
        newest, floors, peaks = -np.inf, [], []
        for arrives, _, _, sent, _ in own:
            if sent > newest:
                floors.append(arrives - sent)
                peaks.append(arrives - newest)
                newest = sent
        assert link.received == len(own) > 30
        assert (link.mean_delay, link.max_delay, link.age) == (sum(delays) / len(delays), max(delays), NOW - newest)
        assert len(floors) < len(own), "some messages are outdated on arrival"
        low, high = np.array(floors), np.array([*peaks[1:], NOW - newest])
        assert link.mean_age == pytest.approx(np.sum(high**2 - low**2) / 2.0 / np.sum(high - low))
        below = np.sum(np.clip(link.p95_age - low, 0.0, high - low))
        assert below == pytest.approx(0.95 * np.sum(high - low))
        assert link.peak_age == pytest.approx(sum(peaks[1:]) / len(peaks[1:]))


def test_reception_log_of_a_long_run_has_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compaction of ages changes the percentile by at most half a class, and means not at all."""
    exact, bounded = ReceptionLog(), ReceptionLog()
    for receiver, entry in entries(3000):
        exact.record(receiver, [entry])
    at_end = exact.statistics_by_link(1000.0)
    monkeypatch.setattr(reception_log, "MAX_BREAKPOINTS", 500)
    monkeypatch.setattr(reception_log, "GRID", 0.04)
    monkeypatch.setattr(reception_log, "MAX_PENDING", 50)
    bounded = ReceptionLog()
    kept = []
    for receiver, entry in entries(3000):
        bounded.record(receiver, [entry])
        kept.append(bounded._ages._number)
    classes = len(at_end) * math.log(LONGEST / SHORTEST) / reception_log.GRID
    assert max(kept) < 2.0 * classes + 100 < 0.5 * exact._ages._number
    for name, link in bounded.statistics_by_link(1000.0).items():
        assert link[:4] == pytest.approx(at_end[name][:4])
        assert (link.mean_age, link.peak_age) == pytest.approx((at_end[name].mean_age, at_end[name].peak_age))
        assert link.p95_age == pytest.approx(at_end[name].p95_age, rel=0.02)


def test_reception_log_without_messages_is_empty() -> None:
    assert ReceptionLog().statistics_by_link(1.0) == {}


def test_reception_statistics_of_a_link_are_independent_of_other_links() -> None:
    """Equality holds to the last bit."""
    complete, one = ReceptionLog(), ReceptionLog()
    for receiver, entry in entries(400):
        complete.record(receiver, [entry])
        if receiver == "B":
            one.record(receiver, [entry])
    alone, among_others = one.statistics_by_link(NOW), complete.statistics_by_link(NOW)
    assert set(alone) == {("A", "B"), ("C", "B")}
    assert all(among_others[link] == receptions for link, receptions in alone.items())


@pytest.mark.parametrize("sender", ["A", "B"])
def test_departure_ends_the_age_of_each_link_once(sender: str) -> None:
    """The age is 0.1 s at 0.1 s, grows to 1.1 s, is 0.1 s again, and grows to 5 s at the departure at 6 s."""
    log = ReceptionLog()
    for number in range(2):
        sent = float(number)
        message = Message(sender, number, sent, StationState(sent, 0, 0, 0, 0, 0), Detections(sent), 100)
        log.record("A", [(sent + 0.1, sender, number, sent, ReceivedMessage(message, sent + 0.1))])
    log.end_links("A", 6.0)
    mean_age = (1.1**2 - 0.1**2 + 5.0**2 - 0.1**2) / 2.0 / (6.0 - 0.1)
    assert log.statistics_by_link(7.0)[sender, "A"].mean_age == pytest.approx(mean_age)
