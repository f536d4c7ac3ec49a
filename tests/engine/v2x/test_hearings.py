"""The books of what was heard: worked off now and then, and always as if message by message."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.randomness import generator
from eidrive_scenario.v2x import hearings
from eidrive_scenario.v2x.hearings import Entry, Hearings
from eidrive_scenario.v2x.message import Message, Received, StationState

NAMES = ("A", "B", "C")


def entries(count: int) -> list[tuple[str, Entry]]:
    """Messages of random delays, so that many overtake each other, in the order in which they arrive."""
    rng = generator(1, "hearings")
    found = []
    for number in range(count):
        said = 0.1 * number
        arrives = said + float(rng.uniform(0.02, 1.5))
        sender, receiver = rng.choice(NAMES, 2, replace=False).tolist()
        message = Message(sender, number, said, StationState(said, 0, 0, 0, 0, 0), Detections(said), 100)
        found.append((receiver, (arrives, sender, number, said, Received(message, arrives))))
    return sorted(found, key=lambda entry: entry[1][0])


@pytest.mark.parametrize("waiting", [0, 1, 7, 10**6])
def test_it_does_not_matter_how_many_wait(monkeypatch: pytest.MonkeyPatch, waiting: int) -> None:
    monkeypatch.setattr(hearings, "MOST_WAITING", waiting)
    kept = Hearings()
    for receiver, entry in entries(400):
        kept.take(receiver, [entry])
        if entry[2] % 50 == 0:
            kept.by_link()
    found = kept.by_link()
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
        assert (heard.delay_sum, heard.delay_max, heard.newest) == (sum(delays), max(delays), newest)
        assert heard.floors.tolist() == floors
        assert heard.peaks.tolist() == peaks[1:]
        assert len(floors) < len(own), "some came too late to be news"


def test_nothing_heard_is_nothing_known() -> None:
    assert Hearings().by_link() == {}
