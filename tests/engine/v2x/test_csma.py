"""Carrier sensing and preamble detection: slots, ties and locks, compared with closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from radio_traffic import QUIET, message, radio

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.csma import CONTENTION_WINDOW
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

WINDOW = CONTENTION_WINDOW + 1
MESSAGES = 4000


def share_of_overlaps(stations: int, begin: float) -> float:
    """Return the share of messages that overlap with another one if queues are never empty."""
    names = [f"S{number}" for number in range(stations)]
    carrier = radio(1, queue={"length": MESSAGES}, jitter=0.0, mtu=10_000, **QUIET)
    carrier.update_environment(RadioEnvironment({name: (5.0 * row, 0.0, 1.5) for row, name in enumerate(names)}))
    full = [
        (message(name, number, begin), [other for other in names if other != name])
        for name in names
        for number in range(MESSAGES)
    ]
    events = [*carrier.transmit(full, begin)]
    carrier.deliver(names[0], begin + 0.5 * MESSAGES * 0.000448)  # while all queues are full
    events += carrier.transmit([], begin + 0.5 * MESSAGES * 0.000448)
    half_duplex = {(event.sender, event.number) for event in events if event.reason == "half_duplex"}
    sent = {(event.sender, event.number) for event in events}
    assert len(sent) > 500
    return len(half_duplex) / len(sent)


def expected_share_of_two() -> float:
    """Return the share of overlapping messages of two stations, from the Markov chain of their remaining slots."""
    chain = np.full((WINDOW, WINDOW), 1.0 / WINDOW**2)
    for _ in range(500):
        after = np.zeros_like(chain)
        for first, second in np.ndindex(chain.shape):
            least, probability = min(first, second), chain[first, second]
            if first == second:
                after += probability / WINDOW**2
            elif first == least:
                after[:, second - least] += probability / WINDOW
            else:
                after[first - least, :] += probability / WINDOW
        chain = after
    both = float(np.trace(chain))
    return 2.0 * both / (1.0 + both)


@pytest.mark.exhaustive
@pytest.mark.parametrize("begin", [0.0, 3600.0, 50_000.0])
def test_two_saturated_stations_overlap_as_often_as_their_markov_chain(begin: float) -> None:
    """A station that has one slot left senses the other one, at any time of a run."""
    assert share_of_overlaps(2, begin) == pytest.approx(expected_share_of_two(), abs=0.02)


@pytest.mark.statistical
@pytest.mark.parametrize("stations", [5, 10])
def test_saturated_stations_overlap_as_in_the_model_of_bianchi(stations: int) -> None:
    """G. Bianchi, IEEE JSAC 18(3), 2000: a station sends in a slot with probability 2 / (W + 1)."""
    sending = 2.0 / (WINDOW + 1.0)
    assert share_of_overlaps(stations, 100.0) == pytest.approx(1.0 - (1.0 - sending) ** (stations - 1), abs=0.03)


def locked(offsets: dict[str, float], places: dict[str, tuple[float, float, float]]) -> dict[tuple[str, str], str]:
    """Return the reasons of losses of one message of each of some stations with these offsets [s], by link."""
    carrier = radio(1, jitter=0.0, **QUIET)
    carrier.update_environment(RadioEnvironment(places))
    outbox = [
        (replace(message(name, 0, 0.0), offset=offset), [other for other in places if other != name])
        for name, offset in offsets.items()
    ]
    events: list[LinkEvent] = [*carrier.transmit(outbox, 0.0)]
    carrier.deliver(next(iter(places)), 0.1)
    events += carrier.transmit([], 0.1)
    return {(event.sender, event.receiver): event.reason for event in events}


def test_receiver_is_free_after_the_message_that_it_locked_to() -> None:
    """Three hidden senders of 0.448 ms: the second overlaps with the first, the third with the second only."""
    reach = 4200.0
    places = {
        "R": (0.0, 0.0, 1.5),
        "A": (-reach, 0.0, 1.5),
        "B": (reach, 0.0, 1.5),
        "C": (0.0, 0.8 * reach, 1.5),
    }
    reasons = locked({"A": 0.0, "B": 0.0003, "C": 0.0006}, places)
    assert reasons["B", "R"] == "busy"
    assert reasons["C", "R"] in ("", "collision")
    assert locked({"A": 0.0, "B": 0.0003}, places)["B", "R"] == "busy"


def test_receiver_below_the_sensing_threshold_of_a_message_is_free() -> None:
    places = {"R": (0.0, 0.0, 1.5), "Far": (60_000.0, 0.0, 1.5), "Near": (-50.0, 0.0, 1.5)}
    reasons = locked({"Far": 0.0, "Near": 0.0003}, places)
    assert reasons["Far", "R"] == "sensing"
    assert reasons["Near", "R"] == ""


def test_station_senses_messages_that_begin_before_its_gate_opens() -> None:
    """The gates of two stations, which met after their first messages, open at 0.1 s and 5 µs later, within one slot.

    The second message of B starts after that of A of 0.448 ms, AIFS of 110 µs, and 0 to 15 slots of 13 µs.
    """
    carrier = radio(1, jitter=0.0, congestion={"kind": "reactive"}, **QUIET)
    carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (200_000.0, 0.0, 1.5)}))
    outbox = [
        (replace(message(name, number, 0.0), offset=offset), [other])
        for number in (0, 1)
        for name, other, offset in (("A", "B", 0.0), ("B", "A", 5e-6))
    ]
    carrier.transmit(outbox, 0.0)
    carrier.deliver("A", 0.05)
    carrier.transmit([], 0.05)
    carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}))
    carrier.deliver("A", 0.2)
    arrivals = {event.sender: event.arrives for event in carrier.transmit([], 0.2)}
    first, second = arrivals["A"], arrivals["B"]
    assert first == pytest.approx(0.100448)
    assert second is not None
    slots = (second - 0.101006) / 13e-6
    assert slots == pytest.approx(round(slots), abs=1e-6)
    assert 0 <= round(slots) <= 15
