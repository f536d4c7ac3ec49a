"""The books of what was heard: worked off now and then, and always as if message by message."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.randomness import generator
from eidrive_scenario.v2x.messages.message import Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.statistics import age_of_information, reception_log
from eidrive_scenario.v2x.statistics.reception_log import Entry, ReceptionLog

NAMES = ("A", "B", "C")
NOW = 45.0
"""After the last arrival [s]."""
SHORTEST, LONGEST = 0.02, 12.0
"""Of all ages [s]."""


def entries(count: int) -> list[tuple[str, Entry]]:
    """Messages of random delays, so that many overtake each other, in the order in which they arrive."""
    rng = generator(1, "hearings")
    found = []
    for number in range(count):
        said = 0.1 * number
        arrives = said + float(rng.uniform(SHORTEST, 1.5))
        sender, receiver = rng.choice(NAMES, 2, replace=False).tolist()
        message = Message(sender, number, said, StationState(said, 0, 0, 0, 0, 0), Detections(said), 100)
        found.append((receiver, (arrives, sender, number, said, ReceivedMessage(message, arrives))))
    return sorted(found, key=lambda entry: entry[1][0])


@pytest.mark.parametrize("waiting", [0, 1, 7, 10**6])
def test_it_does_not_matter_how_many_wait(monkeypatch: pytest.MonkeyPatch, waiting: int) -> None:
    monkeypatch.setattr(reception_log, "MOST_WAITING", waiting)
    kept = ReceptionLog()
    for receiver, entry in entries(400):
        kept.record(receiver, [entry])
        if entry[2] % 50 == 0:
            kept.statistics_by_link(entry[0])
    found = kept.statistics_by_link(NOW)
    assert set(found) == {(a, b) for a in NAMES for b in NAMES if a != b}
    for (sender, receiver), heard in found.items():
        own = [entry for name, entry in entries(400) if (name, entry[1]) == (receiver, sender)]
        delays = [arrives - sent for arrives, _, _, sent, _ in own]
        newest, floors, peaks = -np.inf, [], []
        for arrives, _, _, said, _ in own:
            if said > newest:
                floors.append(arrives - said)
                peaks.append(arrives - newest)
                newest = said
        assert heard.received == len(own) > 30
        assert (heard.delay_sum, heard.delay_max, heard.newest_generation_time) == (sum(delays), max(delays), newest)
        assert len(floors) < len(own), "some came too late to be news"
        low, high = np.array(floors), np.array([*peaks[1:], NOW - newest])
        assert heard.mean_age == pytest.approx(np.sum(high**2 - low**2) / 2.0 / np.sum(high - low))
        below = np.sum(np.clip(heard.p95_age - low, 0.0, high - low))
        assert below == pytest.approx(0.95 * np.sum(high - low))
        assert heard.peak_age == pytest.approx(sum(peaks[1:]) / len(peaks[1:]))


def test_a_long_run_does_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Old ages are sorted into classes: the percentile is off by half of one, averages not at all."""
    exact, bounded = ReceptionLog(), ReceptionLog()
    for receiver, entry in entries(3000):
        exact.record(receiver, [entry])
    at_end = exact.statistics_by_link(1000.0)
    monkeypatch.setattr(age_of_information, "MOST_STEPS", 500)
    monkeypatch.setattr(age_of_information, "GRID", 0.04)
    monkeypatch.setattr(reception_log, "MOST_WAITING", 50)
    bounded = ReceptionLog()
    kept = []
    for receiver, entry in entries(3000):
        bounded.record(receiver, [entry])
        kept.append(bounded._ages._number)
    classes = len(at_end) * math.log(LONGEST / SHORTEST) / age_of_information.GRID
    assert max(kept) < 2.0 * classes + 100 < 0.5 * exact._ages._number
    for link, heard in bounded.statistics_by_link(1000.0).items():
        assert heard[:4] == pytest.approx(at_end[link][:4])
        assert (heard.mean_age, heard.peak_age) == pytest.approx((at_end[link].mean_age, at_end[link].peak_age))
        assert heard.p95_age == pytest.approx(at_end[link].p95_age, rel=0.02)


def test_nothing_heard_is_nothing_known() -> None:
    assert ReceptionLog().statistics_by_link(1.0) == {}


def test_what_is_known_of_a_link_depends_on_no_other() -> None:
    """To the last bit: who else listens changes no book."""
    everybody, one = ReceptionLog(), ReceptionLog()
    for receiver, entry in entries(400):
        everybody.record(receiver, [entry])
        if receiver == "B":
            one.record(receiver, [entry])
    alone, among_others = one.statistics_by_link(NOW), everybody.statistics_by_link(NOW)
    assert set(alone) == {("A", "B"), ("C", "B")}
    assert all(among_others[link] == heard for link, heard in alone.items())
