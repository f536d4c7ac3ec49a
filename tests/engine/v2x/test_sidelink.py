"""C-V2X Mode 4: semi-persistent scheduling and use of resources."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from radio_traffic import message, radio
from sidelink_traffic import MODE_2, MODE_4, TWO, Air, many

from eidrive_scenario.v2x.radio.resource_pool import SidelinkSettings
from eidrive_scenario.v2x.radio_environment import RadioEnvironment


@pytest.mark.parametrize(
    ("interval", "low", "high"), [(0.02, 25, 75), (0.05, 10, 30), (0.1, 5, 15), (0.2, 5, 15), (1.0, 5, 15)]
)
def test_reselection_counter_range_depends_on_the_interval(interval: float, low: int, high: int) -> None:
    """3GPP TS 36.321, 5.14.1.1."""
    assert SidelinkSettings(interval=interval).counter_range == (low, high)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("interval", "tick"), [(0.02, 0.01), (0.05, 0.05), (0.1, 0.1)])
def test_resource_is_used_once_per_interval_for_the_reselection_counter(interval: float, tick: float) -> None:
    air = Air(radio(3, **MODE_4, sidelink={"interval": interval}), TWO, tick)
    air.run(800 * interval, {"A": round(interval / tick)})
    runs: Counter[str] = Counter()
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


def test_last_transmission_on_a_resource_makes_no_reservation() -> None:
    """3GPP TS 36.213, table 14.2.1-2: the reservation is 0 if the resource is not kept."""
    transmissions = Air(radio(3, **MODE_4), TWO, 0.1).run(60.0, {"A": 1}).of("A")
    for first, second in pairwise(transmissions[:-1]):
        kept = (round(1000 * (second.start - first.start)), second.first_band) == (100, first.first_band)
        assert first.reserves == kept or (kept and not first.reserves), "a new resource can equal the previous one"
        assert kept or not first.reserves


@pytest.mark.statistical
@pytest.mark.parametrize("keep", [0.0, 0.4, 0.8])
def test_resource_is_kept_with_the_set_probability(keep: float) -> None:
    """A counter has a mean of 10 uses, and a resource 1 / (1 - keep) counters."""
    air = Air(radio(5, **MODE_4, sidelink={"resource_keep_probability": keep}), TWO, 0.1).run(300.0, {"A": 1})
    changes = sum(not entry.reserves for entry in air.of("A"))
    assert len(air.of("A")) / changes == pytest.approx(10.0 / (1.0 - keep), rel=0.2)


@pytest.mark.parametrize(
    ("size", "width", "length"), [(190, 1, 1), (191, 2, 1), (760, 4, 1), (761, 4, 2), (3000, 4, 4)]
)
def test_message_occupies_subchannels_and_subframes_by_its_size(size: int, width: int, length: int) -> None:
    air = Air(radio(3, **MODE_4), TWO).run(5.0, {"A": 2}, (size,))
    assert len(air.of("A")) > 45
    assert {(e.bands, round(1000 * e.duration)) for e in air.of("A")} == {(width, length)}
    assert all(e.first_band + e.bands <= 4 for e in air.of("A"))
    assert all(event.outcome == "delivered" for event in air.events)


def test_message_larger_than_the_resource_triggers_a_new_selection() -> None:
    """With alternating 190 and 380 bytes the resource grows once; small messages also use it."""
    air = Air(radio(3, **MODE_4), TWO).run(30.0, {"A": 2}, (190, 190, 380, 380))
    widths = [entry.bands for entry in air.of("A")]
    assert set(widths) == {1, 2}
    assert np.mean(np.array(widths) == 2) > 0.7
    assert all(entry.bands >= -(-entry.message.size // 190) for entry in air.of("A"))


def test_message_longer_than_the_interval_does_not_overlap_the_next() -> None:
    """100 kB occupy 132 subframes, more than the interval of 100 ms."""
    air = Air(radio(3, **MODE_4, queue={"discipline": "lcfs"}), TWO).run(5.0, {"A": 1}, (100_000,))
    transmissions = air.of("A")
    assert len(transmissions) > 20
    assert all(later.start >= first.end - 1e-9 for first, later in pairwise(transmissions))
    assert {event.reason for event in air.events} <= {"", "queue", "propagation"}


@pytest.mark.parametrize("latency", [0.02, 0.1, 0.3])
def test_message_delay_respects_the_latency_requirement(latency: float) -> None:
    """Messages at 5 Hz with an interval of 200 ms, with an offset in each third message."""
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


def test_resource_is_released_after_a_second_without_use() -> None:
    air = Air(radio(3, **MODE_4), TWO)
    air.run(0.3, {"A": 2}).run(1.5, {}).run(0.3, {"A": 2})
    first, last = air.of("A")[0], air.of("A")[-1]
    assert round(1000 * (last.start - first.start)) % 100 != 0


@pytest.mark.parametrize(("limit", "kept"), [(None, True), (9, True), (4, True), (3, False), (1, False)])
def test_resource_is_released_after_the_set_number_of_unused_opportunities(limit: int | None, kept: bool) -> None:
    """A gap of 400 ms between messages leaves three opportunities unused."""
    air = Air(radio(3, **MODE_4, sidelink={"reselect_after": limit}), TWO, 0.1)
    air.run(0.1, {"A": 1}).run(0.3, {}).run(0.3, {"A": 1})
    first, second = air.of("A")[:2]
    assert ((second.start - first.start) == pytest.approx(0.4)) is kept


@pytest.mark.parametrize("sidelink", [MODE_4, {**MODE_2, "nr_sidelink": {"transmissions": 2}}], ids=["4", "2"])
def test_resources_are_independent_of_the_time_step(sidelink: dict[str, object]) -> None:
    """Stationary stations with ten messages per second, with time steps of 10 to 100 ms."""
    found = []
    for dt in (0.01, 0.02, 0.05, 0.1):
        places = many(20)
        air = Air(radio(4, **sidelink), places, dt, numbers=round(dt / 0.01))
        air.run(4.0, dict.fromkeys(places, round(0.1 / dt)))
        found.append(
            {(e.message.sender, round(1000 * e.start), e.first_band) for e in air.transmissions if e.start < 3.8}
        )
    assert len(found[0]) > 700
    assert all(other == found[0] for other in found[1:])
