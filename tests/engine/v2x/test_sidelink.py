"""C-V2X Mode 4: semi-persistent scheduling, the resources that stations use and how long."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from radio_talk import message, radio
from sidelink_air import MODE_4, TWO, Air, many

from eidrive_scenario.v2x.radio.sidelink.settings import SidelinkSettings
from eidrive_scenario.v2x.radio_environment import RadioEnvironment


@pytest.mark.parametrize(
    ("interval", "low", "high"), [(0.02, 25, 75), (0.05, 10, 30), (0.1, 5, 15), (0.2, 5, 15), (1.0, 5, 15)]
)
def test_reselection_counter_has_the_range_of_its_interval(interval: float, low: int, high: int) -> None:
    """3GPP TS 36.321, 5.14.1.1."""
    assert SidelinkSettings(interval=interval).counter_range == (low, high)


@pytest.mark.parametrize(("interval", "tick"), [(0.02, 0.01), (0.05, 0.05), (0.1, 0.1)])
def test_resources_are_used_once_per_interval_for_the_reselection_counter(interval: float, tick: float) -> None:
    air = Air(radio(3, **MODE_4, sidelink={"interval": interval}), TWO, tick)
    air.run(800 * interval, {"A": round(interval / tick)})
    runs = Counter()
    lengths, length = [], 1
    for first, second in pairwise(air.of("A")):
        same = (round(1000 * (second.start - first.start)), second.first_band) == (
            round(1000 * interval),
            first.first_band,
        )
        length = length + 1 if same else 1
        if not same:
            lengths.append(runs["now"])
        runs["now"] = length
    low, high = SidelinkSettings(interval=interval).counter_range
    assert min(lengths) >= low
    assert max(lengths) <= high
    assert np.mean(lengths) == pytest.approx((low + high) / 2.0, rel=0.15)


def test_last_transmission_on_a_resource_announces_no_further_use() -> None:
    """3GPP TS 36.213, table 14.2.1-2: the reservation is 0 where the resource is not kept."""
    transmissions = Air(radio(3, **MODE_4), TWO, 0.1).run(60.0, {"A": 1}).of("A")
    for first, second in pairwise(transmissions[:-1]):
        kept = (round(1000 * (second.start - first.start)), second.first_band) == (100, first.first_band)
        assert first.reserves == kept or (kept and not first.reserves), "a new resource may happen to be the old one"
        assert kept or not first.reserves


@pytest.mark.parametrize("keep", [0.0, 0.4, 0.8])
def test_resources_are_kept_with_the_probability_that_was_set(keep: float) -> None:
    """On average 10 uses per counter, and 1 / (1 - keep) counters on each resource."""
    air = Air(radio(5, **MODE_4, sidelink={"resource_keep_probability": keep}), TWO, 0.1).run(300.0, {"A": 1})
    changes = sum(not entry.reserves for entry in air.of("A"))
    assert len(air.of("A")) / changes == pytest.approx(10.0 / (1.0 - keep), rel=0.2)


@pytest.mark.parametrize(
    ("size", "width", "length"), [(190, 1, 1), (191, 2, 1), (760, 4, 1), (761, 4, 2), (3000, 4, 4)]
)
def test_messages_occupy_the_subchannels_and_subframes_that_they_need(size: int, width: int, length: int) -> None:
    air = Air(radio(3, **MODE_4), TWO).run(5.0, {"A": 2}, (size,))
    assert len(air.of("A")) > 45
    assert {(e.bands, round(1000 * e.duration)) for e in air.of("A")} == {(width, length)}
    assert all(e.first_band + e.bands <= 4 for e in air.of("A"))
    assert all(event.outcome == "delivered" for event in air.events)


def test_larger_message_than_the_resource_makes_the_station_select_anew() -> None:
    """190 and 380 bytes in turn: the resource grows once, and small messages go on it too."""
    air = Air(radio(3, **MODE_4), TWO).run(30.0, {"A": 2}, (190, 190, 380, 380))
    widths = [entry.bands for entry in air.of("A")]
    assert set(widths) == {1, 2}
    assert np.mean(np.array(widths) == 2) > 0.7
    assert all(entry.bands >= -(-entry.message.size // 190) for entry in air.of("A"))


def test_message_over_several_ticks_and_intervals_does_not_overlap_the_next() -> None:
    """100 kB take 132 subframes, more than the interval of 100 ms."""
    air = Air(radio(3, **MODE_4, queue={"discipline": "lcfs"}), TWO).run(5.0, {"A": 1}, (100_000,))
    transmissions = air.of("A")
    assert len(transmissions) > 20
    assert all(later.start >= first.end - 1e-9 for first, later in pairwise(transmissions))
    assert {event.reason for event in air.events} <= {"", "queue", "propagation"}


@pytest.mark.parametrize("latency", [0.02, 0.1, 0.3])
def test_messages_wait_no_longer_than_the_latency_requirement(latency: float) -> None:
    """At 5 Hz and an interval of 200 ms, shifted against each other in each third message."""
    carrier = radio(3, **MODE_4, sidelink={"interval": 0.2, "latency": latency, "selection_window": min(latency, 0.1)})
    waits = []
    for tick in range(600):
        now = 0.05 * tick
        carrier.update_environment(RadioEnvironment(TWO))
        due = tick % 12 in (0, 4, 9)
        carrier.transmit([(message("A", tick, now, 190), ["B"])] if due else [], now)
        waits += [r.arrived - r.message.generated for r in carrier.deliver("B", now)]
    assert len(waits) > 140
    assert max(waits) <= max(latency, 0.02) + 0.0011
    assert max(waits) > 0.6 * latency


def test_resource_is_given_up_after_a_second_without_use() -> None:
    air = Air(radio(3, **MODE_4), TWO)
    air.run(0.3, {"A": 2}).run(1.5, {}).run(0.3, {"A": 2})
    first, last = air.of("A")[0], air.of("A")[-1]
    assert round(1000 * (last.start - first.start)) % 100 != 0


@pytest.mark.parametrize(("limit", "kept"), [(None, True), (9, True), (4, True), (3, False), (1, False)])
def test_resource_is_given_up_after_so_many_unused_opportunities(limit: int | None, kept: bool) -> None:
    """Messages with a gap of 400 ms: three opportunities are not used in between."""
    air = Air(radio(3, **MODE_4, sidelink={"reselect_after": limit}), TWO, 0.1)
    air.run(0.1, {"A": 1}).run(0.3, {}).run(0.3, {"A": 1})
    first, second = air.of("A")[:2]
    assert ((second.start - first.start) == pytest.approx(0.4)) is kept


def test_ticks_of_any_length_give_the_same_resources() -> None:
    """Ten messages a second from stations that stand still: a step of 10 ms or of 100 ms makes no difference."""
    found = []
    for dt in (0.01, 0.02, 0.05, 0.1):
        places = many(20)
        air = Air(radio(4, **MODE_4), places, dt).run(4.0, dict.fromkeys(places, round(0.1 / dt)))
        found.append(
            {(e.message.sender, round(1000 * e.start), e.first_band) for e in air.transmissions if e.start < 3.8}
        )
    assert len(found[0]) > 700
    assert all(other == found[0] for other in found[1:])
