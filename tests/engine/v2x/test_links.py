"""Causality and link statistics over random traffic."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from radio_traffic import composed, message, radio

from eidrive_scenario.v2x.channel import Channel, QueuedChannel
from eidrive_scenario.v2x.messages.message import LinkEvent, ReceivedMessage
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_statistics import Links

DT = 0.05
STATIONS = ("Ego", "RSU", "Spectator")


def exchange(
    carrier: Channel, ticks: int, stations: tuple[str, ...] = STATIONS, own: bool = False
) -> tuple[list[LinkEvent], list[tuple[str, float, ReceivedMessage]]]:
    """Send one message per station and tick, in the order of a run: deliver, then send."""
    events: list[LinkEvent] = []
    deliveries: list[tuple[str, float, ReceivedMessage]] = []
    for tick in range(ticks):
        now = tick * DT
        for receiver in stations:
            deliveries += [(receiver, now, received) for received in carrier.deliver(receiver, now)]
        for sender in stations:
            receivers = [name for name in stations if own or name != sender]
            events += carrier.send(message(sender, tick, now), receivers, now)
    return events, deliveries


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
def test_channel_delivers_each_message_once_after_arrival_and_counts_all(
    delay: dict[str, object], loss: dict[str, object], seed: int, reordering: bool, own: bool
) -> None:
    carrier = composed(seed, delay=delay, loss=loss, reordering=reordering)
    events, deliveries = exchange(carrier, 25, own=own)
    by_link = {(event.sender, event.receiver, event.number): event for event in events}
    seen = set()
    for receiver, now, received in deliveries:
        sent = received.message
        event = by_link[sent.sender, receiver, sent.number]
        assert event.outcome == "delivered"
        assert now > sent.generated
        assert received.arrived == event.arrives
        assert event.arrives is not None
        assert event.sent <= event.arrives <= now + 1e-9
        assert now - DT < max(event.arrives, event.sent + 1e-9), "delivery is in the first possible tick"
        assert (sent.sender, receiver, sent.number) not in seen
        seen.add((sent.sender, receiver, sent.number))
    lost = [event for event in events if event.outcome == "lost"]
    pending = [event for link, event in by_link.items() if event.outcome == "delivered" and link not in seen]
    assert all(max(event.arrives or 0.0, event.sent + 1e-9) > 24 * DT for event in pending), "not yet delivered"
    statistics = carrier.statistics(25 * DT)
    assert sum(link.sent for link in statistics.values()) == len(events)
    assert sum(link.received for link in statistics.values()) == len(seen)
    assert sum(link.lost for link in statistics.values()) == len(lost)
    assert sum(link.in_flight for link in statistics.values()) == len(pending)
    assert all(link.sent == link.received + link.lost + link.in_flight for link in statistics.values())


@settings(max_examples=20, deadline=None)
@given(DELAYS, st.integers(0, 3))
def test_channel_without_reordering_delivers_in_order_of_sending(delay: dict[str, object], seed: int) -> None:
    _, deliveries = exchange(composed(seed, delay=delay, reordering=False), 40)
    for receiver in STATIONS:
        for sender in STATIONS:
            numbers = [
                entry.message.number for to, _, entry in deliveries if to == receiver and entry.message.sender == sender
            ]
            assert numbers == sorted(numbers)


@pytest.mark.parametrize("ticks_late", range(1, 25))
def test_delay_of_whole_ticks_is_not_extended_by_rounding(ticks_late: int) -> None:
    _, deliveries = exchange(composed(delay={"kind": "constant", "seconds": ticks_late * DT}), 60)
    lateness = {round(now / DT) - received.message.number for _, now, received in deliveries}
    assert lateness == {ticks_late}


def test_delay_of_the_paper_applies_from_the_first_message() -> None:
    """The published code delivers without delay until its queue is full; here the first delivery is at 0.3 s."""
    _, deliveries = exchange(composed(delay={"kind": "constant", "seconds": 0.3}), 20, ("Ego", "RSU"))
    assert min(now for _, now, _ in deliveries) == pytest.approx(0.3)
    assert {round(now - received.message.generated, 9) for _, now, received in deliveries} == {0.3}


def test_links_deliver_messages_of_one_tick_in_order_of_arrival() -> None:
    links = Links()
    links.send(message("B", 0, 0.0), "Ego", 0.0, 0.09)
    links.send(message("A", 0, 0.0), "Ego", 0.0, 0.07)
    links.send(message("C", 0, 0.0), "Ego", 0.0, 0.07)
    assert [entry.message.sender for entry in links.deliver("Ego", 0.1)] == ["A", "C", "B"]
    assert links.deliver("Ego", 0.1) == ()


def test_links_with_negative_or_undefined_delay_raise() -> None:
    for delay in (-0.01, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="expected at least 0 s, finite"):
            Links().send(message("A", 0, 0.0), "Ego", 0.0, delay)


def test_age_of_information_with_one_loss_equals_hand_calculation() -> None:
    """Sent at 0, 1, 2, 3 s with delays of 0.5 s, the third lost: the age falls to 0.5 at 0.5, 1.5 and 3.5 s."""
    links = Links()
    for second in range(4):
        sent = message("RSU", second, float(second))
        if second == 2:
            links.send(sent, "Ego", float(second), "loss")
        else:
            links.send(sent, "Ego", float(second), 0.5)
    for now in (1.0, 2.0, 3.0, 3.5):
        links.deliver("Ego", now)
    link = links.statistics(4.0)["RSU", "Ego"]
    assert (link.sent, link.received, link.lost, link.in_flight) == (4, 3, 1, 0)
    assert link.mean_delay == link.max_delay == 0.5
    assert link.age == 1.0
    assert link.peak_age == pytest.approx((1.5 + 2.5) / 2)
    # trapezoids: 0.5..1.5 over [0.5, 1.5], 0.5..2.5 over [1.5, 3.5], 0.5..1.0 over [3.5, 4.0]
    assert link.mean_age == pytest.approx((1.0 + 3.0 + 0.375) / 3.5)


@pytest.mark.parametrize(("loss", "delay"), [(0.0, 0.02), (0.3, 0.02), (0.5, 0.3)])
def test_age_of_information_with_independent_loss_has_its_closed_form(loss: float, delay: float) -> None:
    """Periodic sending: mean age d + T (1/q - 1/2), peak age d + T/q."""
    carrier = composed(3, delay={"kind": "constant", "seconds": delay}, loss={"kind": "bernoulli", "probability": loss})
    exchange(carrier, 8000, ("Ego", "RSU"))
    link = carrier.statistics(8000 * DT)["RSU", "Ego"]
    kept = 1.0 - loss
    assert link.mean_age == pytest.approx(delay + DT * (1 / kept - 0.5), rel=0.05)
    assert link.peak_age == pytest.approx(delay + DT / kept, rel=0.05)


def test_continue_from_keeps_messages_in_flight() -> None:
    slow, jammed = (
        composed(delay={"kind": "constant", "seconds": 0.3}),
        composed(loss={"kind": "bernoulli", "probability": 1.0}),
    )
    slow.send(message("RSU", 0, 0.0), ["Ego"], 0.0)
    jammed.continue_from(slow)
    events = jammed.send(message("RSU", 1, 0.05), ["Ego"], 0.05)
    assert events[0].outcome == "lost"
    assert [entry.message.number for entry in jammed.deliver("Ego", 0.3)] == [0]
    assert jammed.statistics(0.3)["RSU", "Ego"].in_flight == 0


@pytest.mark.parametrize("reordering", [True, False])
@pytest.mark.parametrize("models", [(composed, composed), (composed, radio), (radio, composed), (radio, radio)])
def test_channel_without_reordering_waits_for_messages_of_the_replaced_channel(
    models: tuple[Callable[..., QueuedChannel], ...], reordering: bool
) -> None:
    """Message 0 arrives after 1 s and messages 1 and 2, of the next two channels, not before it."""
    places = RadioEnvironment({"RSU": (0.0, 0.0, 5.0), "Ego": (9.0, 0.0, 1.5)})
    arrivals: list[float | None] = []
    previous: QueuedChannel | None = None
    for number, model in enumerate((models[0], models[1], models[0])):
        carrier = model(delay={"kind": "constant", "seconds": 0.0 if number else 1.0}, reordering=reordering)
        if previous is not None:
            carrier.continue_from(previous)
        carrier.update_environment(places)
        now = 0.1 * number
        events = carrier.transmit([(message("RSU", number, now), ["Ego"])], now)
        previous = carrier
        carrier.finalize()
        arrivals += [event.arrives for event in [*events, *carrier.drain_events()]]
    assert arrivals[0] == pytest.approx(1.0, abs=0.02)
    expected = arrivals[:1] * 2 if not reordering else pytest.approx([0.1, 0.2], abs=0.02)
    assert arrivals[1:] == expected


def test_links_count_bytes_sent_per_link() -> None:
    carrier = composed()
    carrier.send(message("RSU", 0, 0.0, size=156), ["Ego", "Spectator"], 0.0)
    assert carrier.statistics(0.0)["RSU", "Ego"].bytes_sent == 156
    assert np.sum([link.bytes_sent for link in carrier.statistics(0.0).values()]) == 312


def test_messages_to_a_station_that_left_are_lost_and_not_delivered_later() -> None:
    """Sent at 0 s with a delay of 0.3 s; the receiver is absent from 0.1 s to 5 s."""
    carrier = composed(delay={"kind": "constant", "seconds": 0.3})
    both = RadioEnvironment({"RSU": (0.0, 0.0, 5.0), "Ego": (9.0, 0.0, 1.5)})
    carrier.update_environment(both)
    carrier.send(message("RSU", 0, 0.0), ["Ego"], 0.0)
    carrier.update_environment(RadioEnvironment({"RSU": (0.0, 0.0, 5.0)}))
    carrier.update_environment(both)
    assert carrier.deliver("Ego", 5.0) == ()
    link = carrier.statistics(5.0)["RSU", "Ego"]
    assert (link.sent, link.lost, link.lost_by, link.in_flight) == (1, 1, {"absent": 1}, 0)


@pytest.mark.parametrize(("absent", "received"), [("Ego", 4), ("RSU", 5)])
def test_age_of_information_is_not_counted_while_a_station_is_absent(absent: str, received: int) -> None:
    """Delays of 0.5 s; present up to 3 s and from 60 s on: two equal cycles of ages 0.5 to 1.5 and 0.5 to 2.

    Message 2 of 2.9 s is in flight when the station leaves: to Ego it is lost, from RSU it arrives, and starts no age.
    """
    links = Links()
    for begin in (0.0, 60.0):
        for number, second in enumerate((0.0, 1.0)):
            links.send(message("RSU", number, begin + second), "Ego", begin + second, 0.5)
        for now in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0):
            links.deliver("Ego", begin + now)
        if begin == 0.0:
            links.send(message("RSU", 2, 2.9), "Ego", 2.9, 1.0)
            links.remove(absent)
            links.deliver("Ego", 4.0)
    link = links.statistics(63.0)["RSU", "Ego"]
    assert link.received == received
    assert link.age == 2.0
    assert link.peak_age == pytest.approx(1.5)
    assert link.mean_age == pytest.approx((1.0 + 1.25 * 1.5) / 2.5)
    assert link.p95_age == pytest.approx(2.0 - 0.05 * 2.5)
