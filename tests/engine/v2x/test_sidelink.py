"""C-V2X Mode 4: semi-persistent scheduling by sensing, the control channel, and the channel busy ratio."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from radio_talk import DT, QUIET, Place, message, radio, talk

from eidrive_scenario.v2x.message import LinkEvent
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.sidelink import Sidelink
from eidrive_scenario.v2x.radio.sidelink_settings import SidelinkSettings
from eidrive_scenario.v2x.surroundings import Surroundings

MODE_4: dict[str, Any] = {**QUIET, "technology": "cv2x_mode4", "jitter": 0.0}
TWO: dict[str, Place] = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}


class Air:
    """Stations on one channel, each with messages of a given size and rate, and all that they transmit."""

    def __init__(
        self, carrier: RadioChannel, places: Mapping[str, Place], dt: float = 0.05, listeners: int | None = None
    ) -> None:
        """Only the first stations, `listeners` of them, receive messages; None: all do."""
        self.carrier, self.places, self.dt, self.tick = carrier, dict(places), dt, 0
        self.listeners = list(places)[:listeners]
        self.events: list[LinkEvent] = []
        self.transmissions: list[Transmission] = []
        begin = carrier._access._begin

        def note(row: int, transmission: Transmission, start: float) -> None:
            begin(row, transmission, start)
            self.transmissions.append(transmission)

        setattr(carrier._access, "_begin", note)  # noqa: B010

    def run(self, seconds: float, every: Mapping[str, int], sizes: Sequence[int] = (190,)) -> Air:
        """Go on; station S has a message in each `every[S]`-th tick."""
        for _ in range(round(seconds / self.dt)):
            now = self.tick * self.dt
            self.carrier.around(Surroundings(self.places))
            outbox = [
                (message(name, self.tick, now, sizes[self.tick % len(sizes)]), [n for n in self.listeners if n != name])
                for name, period in every.items()
                if name in self.places and self.tick % period == 0
            ]
            self.events += self.carrier.transmit(outbox, now)
            self.tick += 1
        return self

    def of(self, name: str) -> list[Transmission]:
        return [entry for entry in self.transmissions if entry.message.sender == name]

    def occupancy(self, since: float, until: float, subchannels: int = 4) -> float:
        """Share of the subchannels of all subframes that some station uses, counted from the transmissions."""
        used = {
            (round(1000 * entry.start) + part, band)
            for entry in self.transmissions
            for part in range(round(1000 * entry.duration))
            for band in range(entry.first_band, entry.first_band + entry.bands)
            if since <= entry.start < until
        }
        return len(used) / (1000.0 * (until - since) * subchannels)


def many(count: int, apart: float = 5.0) -> dict[str, Place]:
    return {f"S{n:03d}": (apart * n, 0.0, 1.5) for n in range(count)}


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
    air = Air(radio(5, **MODE_4, sidelink={"keep": keep}), TWO, 0.1).run(300.0, {"A": 1})
    changes = sum(not entry.reserves for entry in air.of("A"))
    assert len(air.of("A")) / changes == pytest.approx(10.0 / (1.0 - keep), rel=0.2)


def test_stations_that_sense_each_other_hardly_collide() -> None:
    """60 stations for 400 resources: after the first seconds only those collide that select in the same 100 ms."""
    places = many(60)
    air = Air(radio(5, **MODE_4), places, 0.1, listeners=4).run(30.0, dict.fromkeys(places, 1))
    late = [event for event in air.events if event.sent > 4.0]
    reasons = Counter(event.reason for event in late)
    assert set(reasons) <= {"", "half_duplex", "collision", "propagation"}
    assert 0 < reasons["collision"] / len(late) < 0.05, "random choice among 400 resources would lose 14 %"
    assert reasons["half_duplex"] / len(late) == pytest.approx(0.01, abs=0.008)


def test_stations_do_not_receive_in_subframes_in_which_they_transmit() -> None:
    """Two stations whose resources share a subframe lose the messages of each other, in both directions."""
    air = Air(radio(5, **MODE_4), many(10), 0.1).run(40.0, dict.fromkeys(many(10), 1))
    subframe = {(e.message.sender, e.message.number): round(1000 * e.start) for e in air.transmissions}
    sent = {(sender, start) for (sender, _), start in subframe.items()}
    for event in air.events:
        start = subframe.get((event.sender, event.number))
        if start is not None:
            assert (event.reason == "half_duplex") == ((event.receiver, start) in sent)


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
        carrier.around(Surroundings(TWO))
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


@pytest.mark.parametrize(("rate", "size"), [(1, 190), (1, 760), (5, 190), (2, 400)])
def test_busy_ratio_is_the_occupancy_of_subchannels(rate: int, size: int) -> None:
    """40 stations: what C senses agrees with the subchannels that were used, in the subframes that it measured."""
    places = many(40)
    air = Air(radio(2, **MODE_4, sidelink={"interval": 0.1}), places, 0.1, listeners=0)
    air.run(8.0, dict.fromkeys(places, rate), (size,))
    heard = [air.carrier.busy_ratio(name) for name in places]
    assert heard == pytest.approx([air.occupancy(0.0, 7.9)] * 40, abs=0.02)


def test_busy_ratio_counts_the_subchannel_that_is_used_not_the_subframe() -> None:
    """One message of 190 bytes in 10 ms, on one of four subchannels: 2.5 % of the channel, at 10 Hz 0.25 %."""
    carrier = radio(1, **MODE_4)
    talk(carrier, TWO, 400, sizes=(190,), dt=0.1)
    for name in TWO:
        assert carrier.busy_ratio(name) == pytest.approx(0.0025, rel=0.05)


def test_busy_ratio_leaves_out_signals_below_the_threshold() -> None:
    far = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5), "C": (90000.0, 0.0, 1.5)}
    carrier = radio(1, **MODE_4)
    talk(carrier, far, 100, sizes=(190,), dt=0.1)
    assert carrier.busy_ratio("C") == 0.0
    assert (carrier.busy_ratio("B") or 0.0) == pytest.approx(0.0025, rel=0.1)


def test_station_alone_measures_an_empty_channel_and_sends_all_messages() -> None:
    carrier = radio(1, **MODE_4)
    for tick in range(100):
        carrier.around(Surroundings({"A": (0.0, 0.0, 1.5)}))
        carrier.transmit([(message("A", tick, DT * tick, 190), [])], DT * tick)
    assert carrier.busy_ratio("A") == 0.0
    assert isinstance(carrier._access, Sidelink)


def test_message_without_decoded_control_information_is_lost() -> None:
    """From 100 to 2,900 m: a station that does not decode the control information does not receive the message."""
    places = {"A": (0.0, 0.0, 1.5), **{f"R{n}": (100.0 * n, 0.0, 1.5) for n in range(1, 30)}}
    robust, deaf = (
        Air(radio(1, **MODE_4, tx_power_dbm=5, sidelink={"pscch_errors": curve}), places, 0.1).run(20.0, {"A": 1})
        for curve in ("pscch", "80211p_goubet")
    )
    delivered = [sum(e.outcome == "delivered" for e in air.events) for air in (robust, deaf)]
    assert delivered[1] < delivered[0]
    assert {e.reason for e in deaf.events} <= {"", "propagation", "sensing"}


def test_link_statistics_with_joining_and_leaving_stations_are_complete() -> None:
    """Every fourth tick another station comes or goes; nothing vanishes, and resources of the others stay."""
    carrier = radio(2, **MODE_4, queue={"discipline": "lcfs"})
    all_places = many(12, 20.0)
    events, sent = [], 0
    for tick in range(240):
        now = DT * tick
        places = {name: place for row, (name, place) in enumerate(all_places.items()) if (tick // 4) % (row + 2) != 1}
        carrier.around(Surroundings(places))
        for name in places:
            carrier.deliver(name, now)
        outbox = [
            (message(name, tick, now, 190 + 100 * (tick % 5)), [n for n in places if n != name]) for name in places
        ]
        sent += sum(len(receivers) for _, receivers in outbox)
        events += carrier.transmit(outbox, now)
    books = carrier.statistics(240 * DT).values()
    assert sum(book.sent for book in books) == sent
    assert all(book.sent == book.received + book.lost + book.in_flight for book in books)
    assert {event.reason for event in events} >= {"", "absent", "queue", "half_duplex"}


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


@pytest.mark.parametrize(("kind", "period"), [("reactive", 0.1), ("limeric", 0.2)])
def test_congestion_control_acts_on_the_occupancy_of_its_last_period(kind: str, period: float) -> None:
    places = many(40)
    profile = {**MODE_4, "queue": {"discipline": "lcfs"}, "congestion": {"kind": kind}}
    air = Air(radio(3, **profile, sidelink={"interval": 0.05}), places, listeners=0).run(0.05, {})
    gate = air.carrier._access.gate
    measured: list[NDArray[np.float64]] = []
    control = gate.measured
    gate.measured = lambda busy: (measured.append(busy), control(busy))[1]  # type: ignore[method-assign]
    air.run(4.0, dict.fromkeys(places, 1), (190, 760, 380))
    for count, busy in enumerate(measured[: round(3.8 / period)]):
        assert busy == pytest.approx([air.occupancy(period * count, period * (count + 1))] * 40, abs=0.03)
    assert np.mean(measured) > 0.1


@pytest.mark.parametrize(("size", "channel_time"), [(190, 0.25e-3), (760, 1e-3), (1500, 2e-3)])
def test_limeric_counts_the_share_of_the_channel_that_a_message_takes(size: int, channel_time: float) -> None:
    """The shortest interval after a message is its duration times its share of the subchannels, over the station's."""
    profile = {**MODE_4, "congestion": {"kind": "limeric", "share_max": 0.002, "share_min": 0.002}}
    air = Air(radio(3, **profile), TWO).run(1.0, {"A": 2}, (size,))
    assert air.carrier.interval("A") == pytest.approx(channel_time / 0.002)


def test_reactive_control_follows_the_busy_ratio_of_subchannels() -> None:
    """60 stations at 20 Hz want 30 % of the subchannels: above 20 % they send at 5 Hz, at 7.5 % again at 10 Hz."""
    places = many(60)
    profile = {**MODE_4, "queue": {"discipline": "lcfs"}, "sidelink": {"interval": 0.05}}
    free, held = (
        Air(radio(3, **profile, congestion={"kind": kind}), places, listeners=0).run(6.0, dict.fromkeys(places, 1))
        for kind in ("none", "reactive")
    )
    assert free.occupancy(2.0, 5.9) == pytest.approx(0.3, abs=0.02)
    assert held.occupancy(2.0, 5.9) == pytest.approx(0.15, abs=0.02)
    assert {held.carrier.interval(name) for name in places} == {0.1}
