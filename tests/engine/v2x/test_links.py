"""Causality and books, over random traffic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eidrive_scenario.detections import Detections
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.statistics.links import Links

DT = 0.05
STATIONS = ("Ego", "RSU", "Spectator")


def message(sender: str, number: int, time: float, size: int = 121) -> Message:
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), size)


def channel(seed: int = 0, **profile: object) -> ComposedChannel:
    return ComposedChannel(ComposedProfile.model_validate(profile), seed)


def talk(
    carrier: Channel, ticks: int, stations: tuple[str, ...] = STATIONS, own: bool = False
) -> tuple[list[LinkEvent], list[tuple[str, float, ReceivedMessage]]]:
    """Every station says one message per tick; the order is that of a run: deliver, then send."""
    events: list[LinkEvent] = []
    heard: list[tuple[str, float, ReceivedMessage]] = []
    for tick in range(ticks):
        now = tick * DT
        for receiver in stations:
            heard += [(receiver, now, received) for received in carrier.deliver(receiver, now)]
        for sender in stations:
            receivers = [name for name in stations if own or name != sender]
            events += carrier.send(message(sender, tick, now), receivers, now)
    return events, heard


DELAYS = st.one_of(
    st.floats(0, 1).map(lambda seconds: {"kind": "constant", "seconds": seconds}),
    st.tuples(st.floats(0, 0.5), st.floats(0, 0.5)).map(
        lambda bounds: {"kind": "uniform", "minimum": min(bounds), "maximum": max(bounds)}
    ),
    st.tuples(st.floats(0, 0.2), st.floats(0, 0.4)).map(
        lambda pair: {"kind": "shifted_gamma", "minimum": pair[0], "mean": pair[0] + pair[1]}
    ),
    st.tuples(st.floats(0.01, 0.4), st.floats(0.01, 0.4)).map(
        lambda pair: {"kind": "lognormal", "mean": pair[0], "sd": pair[1]}
    ),
    st.floats(-0.1, 0.5).map(lambda mean: {"kind": "truncated_normal", "mean": mean, "sd": 0.1, "maximum": 0.6}),
)
LOSSES = st.one_of(
    st.just({"kind": "none"}),
    st.tuples(st.floats(0, 1), st.sampled_from(["link", "frame"])).map(
        lambda pair: {"kind": "bernoulli", "probability": pair[0], "scope": pair[1]}
    ),
)


@settings(max_examples=60, deadline=None)
@given(DELAYS, LOSSES, st.integers(0, 5), st.booleans(), st.booleans())
def test_nothing_is_heard_before_it_arrives_nor_twice_and_nothing_vanishes(
    delay: dict[str, object], loss: dict[str, object], seed: int, reordering: bool, own: bool
) -> None:
    carrier = channel(seed, delay=delay, loss=loss, reordering=reordering)
    events, heard = talk(carrier, 25, own=own)
    by_link = {(event.sender, event.receiver, event.number): event for event in events}
    seen = set()
    for receiver, now, received in heard:
        said = received.message
        event = by_link[said.sender, receiver, said.number]
        assert event.outcome == "delivered"
        assert now > said.generated
        assert received.arrived == event.arrives
        assert event.arrives is not None
        assert event.sent <= event.arrives <= now + 1e-9
        assert now - DT < max(event.arrives, event.sent + 1e-9), "it was heard in the first tick in which it could be"
        assert (said.sender, receiver, said.number) not in seen
        seen.add((said.sender, receiver, said.number))
    lost = [event for event in events if event.outcome == "lost"]
    assert len(events) == len(seen) + len(lost) + carrier.in_flight()
    books = carrier.statistics(25 * DT)
    assert sum(book.sent for book in books.values()) == len(events)
    assert sum(book.received for book in books.values()) == len(seen)
    assert sum(book.lost for book in books.values()) == len(lost)
    assert sum(book.in_flight for book in books.values()) == carrier.in_flight()
    assert all(book.sent == book.received + book.lost + book.in_flight for book in books.values())


@settings(max_examples=20, deadline=None)
@given(DELAYS, st.integers(0, 3))
def test_without_reordering_a_link_keeps_the_order(delay: dict[str, object], seed: int) -> None:
    _, heard = talk(channel(seed, delay=delay, reordering=False), 40)
    for receiver in STATIONS:
        for sender in STATIONS:
            numbers = [
                entry.message.number for to, _, entry in heard if to == receiver and entry.message.sender == sender
            ]
            assert numbers == sorted(numbers)


@pytest.mark.parametrize("ticks_late", range(1, 25))
def test_a_delay_of_whole_ticks_is_not_a_tick_longer_by_rounding(ticks_late: int) -> None:
    _, heard = talk(channel(delay={"kind": "constant", "seconds": ticks_late * DT}), 60)
    lateness = {round(now / DT) - received.message.number for _, now, received in heard}
    assert lateness == {ticks_late}


def test_the_paper_s_latency_is_six_ticks_of_20_hz_also_during_the_first_six() -> None:
    """The published code gives out undelayed data until its queue is full; here nothing is heard before 0.3 s."""
    _, heard = talk(channel(delay={"kind": "constant", "seconds": 0.3}), 20, ("Ego", "RSU"))
    assert min(now for _, now, _ in heard) == pytest.approx(0.3)
    assert {round(now - received.message.generated, 9) for _, now, received in heard} == {0.3}


def test_messages_of_one_tick_come_in_the_order_of_their_arrival() -> None:
    links = Links()
    links.enqueue_delivery(message("B", 0, 0.0), "Ego", 0.0, 0.09)
    links.enqueue_delivery(message("A", 0, 0.0), "Ego", 0.0, 0.07)
    links.enqueue_delivery(message("C", 0, 0.0), "Ego", 0.0, 0.07)
    assert [entry.message.sender for entry in links.deliver("Ego", 0.1)] == ["A", "C", "B"]
    assert links.deliver("Ego", 0.1) == ()


def test_a_negative_or_undefined_delay_is_refused() -> None:
    for delay in (-0.01, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="expected seconds from 0 on, finite"):
            Links().enqueue_delivery(message("A", 0, 0.0), "Ego", 0.0, delay)


def test_age_of_information_by_hand() -> None:
    """Said at 0, 1, 2, 3 s, delays 0.5 s, the third lost: the age falls to 0.5 at 0.5, 1.5 and 3.5 s."""
    links = Links()
    for second in range(4):
        said = message("RSU", second, float(second))
        if second == 2:
            links.record_loss(said, "Ego", float(second), "loss")
        else:
            links.enqueue_delivery(said, "Ego", float(second), 0.5)
    for now in (1.0, 2.0, 3.0, 3.5):
        links.deliver("Ego", now)
    book = links.statistics(4.0)["RSU", "Ego"]
    assert (book.sent, book.received, book.lost, book.in_flight) == (4, 3, 1, 0)
    assert book.mean_delay == book.max_delay == 0.5
    assert book.age == 1.0
    assert book.peak_age == pytest.approx((1.5 + 2.5) / 2)
    # trapezoids: 0.5..1.5 over [0.5, 1.5], 0.5..2.5 over [1.5, 3.5], 0.5..1.0 over [3.5, 4.0]
    assert book.mean_age == pytest.approx((1.0 + 3.0 + 0.375) / 3.5)


@pytest.mark.parametrize(("loss", "delay"), [(0.0, 0.02), (0.3, 0.02), (0.5, 0.3)])
def test_mean_age_of_information_has_its_closed_form(loss: float, delay: float) -> None:
    """Periodic sending, independent loss: d + T (1/q - 1/2) in the mean, d + T/q just before an update."""
    carrier = channel(3, delay={"kind": "constant", "seconds": delay}, loss={"kind": "bernoulli", "probability": loss})
    talk(carrier, 8000, ("Ego", "RSU"))
    book = carrier.statistics(8000 * DT)["RSU", "Ego"]
    kept = 1.0 - loss
    assert book.mean_age == pytest.approx(delay + DT * (1 / kept - 0.5), rel=0.05)
    assert book.peak_age == pytest.approx(delay + DT / kept, rel=0.05)


def test_a_channel_that_is_replaced_hands_over_what_is_on_its_way() -> None:
    slow, jammed = (
        channel(delay={"kind": "constant", "seconds": 0.3}),
        channel(loss={"kind": "bernoulli", "probability": 1.0}),
    )
    slow.send(message("RSU", 0, 0.0), ["Ego"], 0.0)
    jammed.continue_from(slow)
    events = jammed.send(message("RSU", 1, 0.05), ["Ego"], 0.05)
    assert events[0].outcome == "lost"
    assert [entry.message.number for entry in jammed.deliver("Ego", 0.3)] == [0]
    assert jammed.in_flight() == 0


def test_sizes_are_counted() -> None:
    carrier = channel()
    carrier.send(message("RSU", 0, 0.0, size=156), ["Ego", "Spectator"], 0.0)
    assert carrier.statistics(0.0)["RSU", "Ego"].bytes_sent == 156
    assert np.sum([book.bytes_sent for book in carrier.statistics(0.0).values()]) == 312
