"""Who talks when on the radio, and what becomes of messages that meet: sensing, resources, queues, congestion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radio_talk import DT, QUIET, message, radio, talk

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

BUSY = {"kind": "80211p", "density": 0.12, "rate": 25, "size": 500}
"""Traffic that fills 77 % of the channel."""


def test_stations_that_hear_each_other_take_turns() -> None:
    """Ten stations speak at once in each tick; only those that start within one slot of another are lost."""
    places = {f"S{n}": (10.0 * n, 0.0, 1.5) for n in range(10)}
    events, _ = talk(radio(1, **QUIET), places, 200)
    lost = [event for event in events if event.outcome == "lost"]
    assert {event.reason for event in lost} <= {"half_duplex", "collision", "busy"}
    assert len(lost) / len(events) < 0.1
    alone, _ = talk(radio(1, **QUIET), dict(list(places.items())[:1] + list(places.items())[-1:]), 200)
    assert sum(event.outcome == "lost" for event in alone) <= 4


def test_hidden_stations_collide_where_they_do_not_hear_each_other() -> None:
    """A and C hear B but not each other; the middle one loses what overlaps, the longer the messages the more."""
    sensing = {"sensing_dbm": -85.0}
    reach = {"A": (0.0, 0.0, 1.5), "B": (4200.0, 0.0, 1.5), "C": (8400.0, 0.0, 1.5)}
    shares = []
    for size in (100, 1400):
        events, _ = talk(radio(2, **{**QUIET, **sensing}), reach, 400, sizes=(size,))
        at_middle = [event for event in events if event.receiver == "B" and event.sender != "B"]
        assert {e.reason for e in events if {e.sender, e.receiver} == {"A", "C"}} <= {"sensing", "half_duplex"}
        shares.append(np.mean([e.reason in ("busy", "collision", "half_duplex") for e in at_middle]))
    assert shares[1] > 2 * shares[0] > 0.0


def test_the_newest_message_takes_the_place_of_one_that_waits() -> None:
    """20 Hz into resources of 10 Hz: half of the messages are replaced, and the others are never old."""
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}
    profile = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.1}}
    newest = talk(radio(1, queue={"discipline": "lcfs"}, **profile), places, 400)[0]
    queued = talk(radio(1, queue={"discipline": "fifo", "length": 5}, **profile), places, 400)[0]
    for events in (newest, queued):
        assert np.mean([event.reason == "queue" for event in events]) == pytest.approx(0.5, abs=0.03)
    delays = [
        max(event.arrives - event.sent for event in events if event.arrives is not None) for events in (newest, queued)
    ]
    assert delays[0] < 0.16
    assert delays[1] > 0.4


def kinds_said(carrier: RadioChannel, ticks: int, *kinds: str) -> list[LinkEvent]:
    """A says one message of each kind in every tick, numbered one after the other; B listens."""
    events: list[LinkEvent] = []
    for tick in range(ticks):
        now = tick * DT
        carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}))
        said = [replace(message("A", tick * len(kinds) + part, now), kind=kind) for part, kind in enumerate(kinds)]  # type: ignore[arg-type]
        events += carrier.transmit([(one, ["B"]) for one in said], now)
    return events


def test_news_of_one_kind_do_not_take_the_place_of_another() -> None:
    """One resource for two messages a tick: each kind goes every other time, neither starves."""
    settings = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.05, "subchannel_bytes": 300}}
    events = kinds_said(radio(1, queue={"discipline": "lcfs"}, **settings), 200, "cam", "cpm")
    heard = [event.number % 2 for event in events if event.outcome == "delivered"]
    assert len(heard) == pytest.approx(200, abs=5)
    assert sum(heard) == pytest.approx(100, abs=5)


def test_parts_of_one_report_do_not_take_each_other_s_place() -> None:
    """What does not fit into one CPM goes in two: with room for two messages in a tick all of them arrive."""
    settings = {**QUIET, "technology": "cv2x_mode4", "sidelink": {"interval": 0.02, "subchannel_bytes": 300}}
    events = kinds_said(radio(1, queue={"discipline": "lcfs"}, **settings), 200, "cpm", "cpm")
    assert {event.reason for event in events} <= {"", "propagation"}
    assert len(events) > 390


@pytest.mark.parametrize(
    ("congestion", "least"),
    [({"kind": "reactive"}, 1.0), ({"kind": "limeric"}, 0.448 / 0.6), ({"kind": "none"}, 0.0)],
)
def test_congestion_control_knows_of_the_traffic_in_the_background(congestion: dict[str, str], least: float) -> None:
    """77 % busy is beyond LIMERIC's target of 68 %: shares fall to the least one. 300 bytes take 0.448 ms."""
    carrier = radio(1, congestion=congestion, background=BUSY, queue={"discipline": "lcfs"}, **QUIET)
    events = kinds_said(carrier, 400, "cpm")
    assert carrier.min_message_interval("A") == pytest.approx(least)
    assert carrier.min_message_interval("nobody") == 0.0
    starts = [event.sent for event in events if event.reason != "queue"]
    assert len(starts) == pytest.approx(20.0 / max(least, DT), abs=1.5)


def test_limeric_holds_a_saturated_channel_at_its_fixed_point() -> None:
    """25 stations that always have something to say: the busy ratio settles at 0.4435 (docs of LIMERIC)."""
    places = {f"S{n:02}": (4.0 * n, 0.0, 1.5) for n in range(25)}
    profile = {**QUIET, "congestion": {"kind": "limeric"}, "queue": {"discipline": "lcfs"}, "jitter": 0.01}
    carrier = radio(3, **profile)
    times = {}
    for tick in range(1200):
        now = tick * 0.01
        carrier.update_environment(RadioEnvironment(places))
        carrier.transmit([(message(name, tick, now), []) for name in places], now)
        if tick in (799, 1199):
            times[tick] = np.mean([now * (carrier.channel_busy_ratio(name) or 0.0) for name in places])
    assert (times[1199] - times[799]) / 4.0 == pytest.approx(0.4435, rel=0.05)


def test_background_traffic_costs_receptions_and_fills_the_channel() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (150.0, 0.0, 1.5)}
    free = radio(1, **QUIET)
    events, _ = talk(free, places, 1000)
    full = radio(1, background=BUSY, **QUIET)
    crowded, _ = talk(full, places, 1000)
    assert {e.reason for e in crowded if e.outcome == "lost"} >= {"busy", "collision"}
    kept = [{(e.sender, e.number) for e in told if e.outcome == "delivered"} for told in (events, crowded)]
    assert kept[1] < kept[0]
    assert (full.channel_busy_ratio("B") or 0.0) - (free.channel_busy_ratio("B") or 0.0) == pytest.approx(
        0.7737, abs=0.001
    )


def test_a_message_without_listeners_still_takes_its_time_on_the_air() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}
    carrier = radio(1, **QUIET)
    for tick in range(100):
        carrier.update_environment(RadioEnvironment(places))
        assert list(carrier.transmit([(message("A", tick, tick * DT), [])], tick * DT)) == []
    assert carrier.channel_busy_ratio("B") == pytest.approx(0.000448 / DT, rel=0.03)
