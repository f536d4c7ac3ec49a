"""Medium access: carrier sensing, resources, queues, collisions, congestion control."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from radio_traffic import DT, QUIET, exchange, message, radio

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.reception import Interference
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

BUSY = {"kind": "80211p", "density": 0.12, "rate": 25, "size": 500}
"""Background traffic with a channel busy ratio of 77 %."""


def test_csma_stations_in_sensing_range_defer_to_each_other() -> None:
    """Ten stations send in each tick; only messages that start within one slot of another are lost."""
    places = {f"S{n}": (10.0 * n, 0.0, 1.5) for n in range(10)}
    events, _ = exchange(radio(1, **QUIET), places, 200)
    lost = [event for event in events if event.outcome == "lost"]
    assert {event.reason for event in lost} <= {"half_duplex", "collision", "busy"}
    assert len(lost) / len(events) < 0.1
    alone, _ = exchange(radio(1, **QUIET), dict(list(places.items())[:1] + list(places.items())[-1:]), 200)
    assert sum(event.outcome == "lost" for event in alone) <= 4


def test_csma_hidden_stations_collide_more_with_longer_messages() -> None:
    """A and C sense B but not each other, so B loses overlapping messages."""
    sensing = {"sensing_dbm": -85.0}
    reach = {"A": (0.0, 0.0, 1.5), "B": (4200.0, 0.0, 1.5), "C": (8400.0, 0.0, 1.5)}
    shares = []
    for size in (100, 1400):
        events, _ = exchange(radio(2, **{**QUIET, **sensing}), reach, 400, sizes=(size,))
        at_middle = [event for event in events if event.receiver == "B" and event.sender != "B"]
        assert {e.reason for e in events if {e.sender, e.receiver} == {"A", "C"}} <= {"sensing", "half_duplex"}
        shares.append(np.mean([e.reason in ("busy", "collision", "half_duplex") for e in at_middle]))
    assert shares[1] > 2 * shares[0] > 0.0


def test_lcfs_queue_replaces_outdated_messages() -> None:
    """20 Hz on resources of 10 Hz: half of the messages are replaced, and the delay of the others is bounded."""
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}
    profile = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.1}}
    newest = exchange(radio(1, queue={"discipline": "lcfs"}, **profile), places, 400)[0]
    queued = exchange(radio(1, queue={"discipline": "fifo", "length": 5}, **profile), places, 400)[0]
    for events in (newest, queued):
        assert np.mean([event.reason == "queue" for event in events]) == pytest.approx(0.5, abs=0.03)
    delays = [
        max(event.arrives - event.sent for event in events if event.arrives is not None) for events in (newest, queued)
    ]
    assert delays[0] < 0.16
    assert delays[1] > 0.4


def send_kinds(carrier: RadioChannel, ticks: int, *kinds: str) -> list[LinkEvent]:
    """Send one message of each kind from A to B in every tick, with consecutive numbers."""
    events: list[LinkEvent] = []
    for tick in range(ticks):
        now = tick * DT
        carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}))
        sent = [replace(message("A", tick * len(kinds) + part, now), kind=kind) for part, kind in enumerate(kinds)]
        events += carrier.transmit([(one, ["B"]) for one in sent], now)
    return events


def test_lcfs_queue_keeps_messages_of_other_kinds() -> None:
    """One resource for two messages per tick: the kinds alternate."""
    settings = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.05, "subchannel_bytes": 300}}
    events = send_kinds(radio(1, queue={"discipline": "lcfs"}, **settings), 200, "cam", "cpm")
    kinds = [event.number % 2 for event in events if event.outcome == "delivered"]
    assert len(kinds) == pytest.approx(200, abs=5)
    assert sum(kinds) == pytest.approx(100, abs=5)


def test_lcfs_queue_keeps_all_messages_of_one_tick() -> None:
    """A report in two CPMs: with a capacity of two messages per tick all arrive."""
    settings = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.02, "subchannel_bytes": 300}}
    events = send_kinds(radio(1, queue={"discipline": "lcfs"}, **settings), 200, "cpm", "cpm")
    assert {event.reason for event in events} <= {"", "propagation"}
    assert len(events) > 390


@pytest.mark.parametrize("discipline", ["fifo", "lcfs"])
def test_queue_of_feature_frames_drops_the_last_frames(discipline: str) -> None:
    """A CPM with 40 frames every 0.1 s: a queue of 16 takes the CPM and the first 15, however they are delayed."""
    queue = {"discipline": discipline, "length": 16}
    carrier = radio(1, queue=queue, **QUIET)
    outcomes: dict[str, set[int]] = {"delivered": set(), "lost": set()}
    for period in range(50):
        now = 0.1 * period
        carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}))
        report = [replace(message("A", 41 * period, now), offset=0.02)]
        frames = [
            replace(message("A", 41 * period + part, now, 1400), kind="features", offset=0.02) for part in range(1, 41)
        ]
        for event in carrier.transmit([(one, ["B"]) for one in [*report, *frames]], now):
            outcomes[event.outcome].add(event.number % 41)
    assert outcomes == {"delivered": set(range(16)), "lost": set(range(16, 41))}


@pytest.mark.parametrize(
    ("congestion", "least"),
    [({"kind": "reactive"}, 1.0), ({"kind": "limeric"}, 0.448 / 0.6), ({"kind": "none"}, 0.0)],
)
def test_congestion_control_includes_background_traffic(congestion: dict[str, str], least: float) -> None:
    """77 % exceeds the LIMERIC target of 68 %, so shares fall to the minimum. 300 bytes take 0.448 ms."""
    carrier = radio(1, congestion=congestion, background=BUSY, queue={"discipline": "lcfs"}, **QUIET)
    events = send_kinds(carrier, 400, "cpm")
    assert carrier.min_message_interval("A") == pytest.approx(least)
    assert carrier.min_message_interval("absent") == 0.0
    starts = [event.sent for event in events if event.reason != "queue"]
    assert len(starts) == pytest.approx(20.0 / max(least, DT), abs=1.5)


@pytest.mark.statistical
def test_limeric_saturated_channel_converges_to_the_fixed_point() -> None:
    """With 25 saturated stations the channel busy ratio converges to 0.4435 (see test_congestion).

    The fixed point is that of messages that do not overlap: the stations start one after the other.
    """
    places = {f"S{n:02}": (4.0 * n, 0.0, 1.5) for n in range(25)}
    congestion = {"kind": "limeric", "interval_min": 0.01}
    carrier = radio(3, congestion=congestion, queue={"discipline": "lcfs"}, jitter=0.0, **QUIET)
    times = {}
    for tick in range(2400):
        now = tick * 0.01
        carrier.update_environment(RadioEnvironment(places))
        outbox = [replace(message(name, tick, now), offset=0.001 * row) for row, name in enumerate(places)]
        carrier.transmit([(one, []) for one in outbox], now)
        if tick in (1999, 2399):
            times[tick] = np.mean([now * (carrier.channel_busy_ratio(name) or 0.0) for name in places])
    assert (times[2399] - times[1999]) / 4.0 == pytest.approx(0.4435, rel=0.01)


@pytest.mark.statistical
def test_background_traffic_reduces_deliveries_and_raises_busy_ratio() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (150.0, 0.0, 1.5)}
    free = radio(1, **QUIET)
    events, _ = exchange(free, places, 1000)
    full = radio(1, background=BUSY, **QUIET)
    crowded, _ = exchange(full, places, 1000)
    assert {e.reason for e in crowded if e.outcome == "lost"} >= {"busy", "collision"}
    kept = [{(e.sender, e.number) for e in links if e.outcome == "delivered"} for links in (events, crowded)]
    assert kept[1] < kept[0]
    assert (full.channel_busy_ratio("B") or 0.0) - (free.channel_busy_ratio("B") or 0.0) == pytest.approx(
        0.7737, abs=0.001
    )


def test_transmission_without_receivers_occupies_the_channel() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}
    carrier = radio(1, **QUIET)
    for tick in range(100):
        carrier.update_environment(RadioEnvironment(places))
        assert list(carrier.transmit([(message("A", tick, tick * DT), [])], tick * DT)) == []
    assert carrier.channel_busy_ratio("B") == pytest.approx(0.000448 / DT, rel=0.03)


@pytest.mark.parametrize(
    ("shares", "errors", "expected"),
    [
        ((1.0,), (0.3,), 0.3),
        ((0.25, 0.75), (0.5, 0.0), 1.0 - 0.5**0.25),
        ((0.5, 0.5), (0.5, 0.5), 0.5),
        ((0.01, 0.99), (1.0, 0.0), 1.0),
    ],
)
def test_errors_of_parts_combine_by_their_shares_of_the_message(
    shares: tuple[float, ...], errors: tuple[float, ...], expected: float
) -> None:
    """1 - PER is the product of (1 - PER of the part)^share. A part that is certainly lost destroys the message."""
    parts = Interference(3, np.full(len(shares), 1), np.array(shares), np.zeros((len(shares), 1)))
    assert parts.combine(np.array(errors)[:, None])[:, 0] == pytest.approx([0.0, expected, 0.0])
