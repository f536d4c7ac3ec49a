"""NR-V2X Mode 2: physical layer, resource selection, retransmissions."""

from __future__ import annotations

from collections import Counter, defaultdict
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from radio_traffic import message, radio
from sidelink_traffic import MODE_2, TWO, Air, many

from eidrive_scenario.errors import SettingError
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.profile import load_profile
from eidrive_scenario.v2x.radio.nr_physical_layer import transport_block_bits
from eidrive_scenario.v2x.radio.packet_error import coded_curve, coded_errors
from eidrive_scenario.v2x.radio.resource_pool import NrSidelinkSettings
from eidrive_scenario.v2x.radio_environment import RadioEnvironment


@pytest.mark.parametrize(
    ("mcs", "elements", "bits"),
    [(0, 100, 24), (3, 330, 160), (7, 780, 808), (11, 557, 848), (11, 2000, 2976), (16, 3517, 8968), (28, 9000, 50184)],
)
def test_transport_block_size_equals_that_of_wilabv2xsim(mcs: int, elements: int, bits: int) -> None:
    """The sizes of another implementation of TS 38.214, 5.1.3.2."""
    assert transport_block_bits(elements, mcs) == bits


def test_long_codes_reach_the_capacity_of_their_modulation() -> None:
    """Rate 1/2 of binary antipodal signals needs 0.187 dB, and a low rate that of Gaussian signals."""
    assert coded_errors(0.15, 10**7, 10**7, 2) > 0.99
    assert coded_errors(0.22, 10**7, 10**7, 2) < 0.01
    rate = 0.1
    gaussian = 10.0 * np.log10(2.0**rate - 1.0)
    assert coded_errors(gaussian + 0.1, round(rate * 10**7), 10**7, 6) < 0.01


def test_short_codes_need_more_power_than_long_ones() -> None:
    """Polyanskiy et al. 2010: the loss in rate is about sqrt(V / n) Q^-1(PER)."""
    at_one_percent = [coded_curve(n // 2, n // 2, 2, None).ratio_of(0.01) for n in (100_000, 2_000, 200)]
    assert at_one_percent == sorted(at_one_percent)
    assert at_one_percent[0] == pytest.approx(0.187, abs=0.15)


@pytest.mark.parametrize(("spacing", "slots"), [(15, 10), (30, 20), (60, 40)])
def test_slot_lasts_15_khz_over_the_subcarrier_spacing_in_milliseconds(spacing: int, slots: int) -> None:
    pool = {"subcarrier_spacing_khz": spacing, "bandwidth_mhz": 40}
    air = Air(radio(3, **MODE_2, nr_sidelink=pool), TWO).run(2.0, {"A": 2})
    starts = np.array([entry.start for entry in air.of("A")])
    assert {round(entry.duration * 1e6) for entry in air.of("A")} == {10_000 // slots}
    assert np.allclose(starts * 100.0 * slots, np.round(starts * 100.0 * slots))
    assert all(event.outcome == "delivered" for event in air.events)


@pytest.mark.parametrize(
    ("bandwidth", "spacing", "blocks", "count"), [(10, 15, 10, 5), (20, 30, 10, 5), (40, 15, 10, 21), (10, 60, 10, 1)]
)
def test_carrier_has_the_subchannels_of_its_bandwidth(bandwidth: int, spacing: int, blocks: int, count: int) -> None:
    """TS 38.101-1, table 5.3.2-1: 52, 51, 216 and 11 resource blocks."""
    pool = NrSidelinkSettings.model_validate(
        {"bandwidth_mhz": bandwidth, "subcarrier_spacing_khz": spacing, "subchannel_blocks": blocks}
    )
    assert pool.subchannels == count


def test_message_larger_than_a_slot_occupies_consecutive_slots() -> None:
    air = Air(radio(3, **MODE_2), TWO).run(3.0, {"A": 4}, (5000,))
    assert {entry.bands for entry in air.of("A")} == {5}
    assert len(air.of("A")) == 15
    assert {round(1000 * entry.duration) for entry in air.of("A")} == {NrSidelinkSettings().extent(5000)[1]}


def test_aperiodic_messages_select_a_new_resource_each() -> None:
    air = Air(radio(3, **MODE_2, nr_sidelink={"periodic": False}), TWO, 0.1).run(20.0, {"A": 1})
    assert not any(entry.reserves for entry in air.of("A"))
    offsets = Counter(round(1000 * entry.start) % 100 for entry in air.of("A"))
    assert max(offsets.values()) < 10


@pytest.mark.parametrize("count", [2, 3])
def test_transmissions_of_a_message_are_in_different_slots_within_32(count: int) -> None:
    air = Air(radio(3, **MODE_2, nr_sidelink={"transmissions": count}), many(6), 0.1)
    air.run(20.0, dict.fromkeys(many(6), 1))
    slots: defaultdict[tuple[str, int], list[int]] = defaultdict(list)
    for entry in air.transmissions:
        if entry.message.number < 190:  # the last ones are under way at the end
            slots[entry.message.sender, entry.message.number].append(round(1000 * entry.start))
    assert {len(each) for each in slots.values()} == {count}
    assert all(later > earlier for each in slots.values() for earlier, later in pairwise(each))
    assert all(each[-1] - each[0] < 32 for each in slots.values())


@pytest.mark.statistical
def test_independent_transmissions_lose_the_product_of_their_error_rates() -> None:
    """At a distance with a packet error rate p by noise, n transmissions lose p^n."""
    places = {"A": (0.0, 0.0, 1.5), "B": (900.0, 0.0, 1.5)}
    quiet: dict[str, Any] = {
        **MODE_2,
        "path_loss": {"kind": "log_distance", "exponent": 2.5},
        "fading": {"kind": "nakagami", "m": 1},
        "antenna_gain_dbi": 0,
    }
    lost = []
    for count in (1, 2, 3):
        pool = {"transmissions": count, "mcs": 4, "interval": 0.1}
        air = Air(radio(7, **quiet, nr_sidelink=pool), places, 0.1, listeners=2).run(300.0, {"A": 1})
        assert len({event.number for event in air.events}) == len(air.events) >= 2999
        lost.append(sum(event.outcome == "lost" for event in air.events) / len(air.events))
    assert 0.3 < lost[0] < 0.9
    assert lost[1] == pytest.approx(lost[0] ** 2, abs=0.03)
    assert lost[2] == pytest.approx(lost[0] ** 3, abs=0.03)


def test_message_of_a_sender_that_leaves_between_transmissions_is_lost_once() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (100.0, 0.0, 1.5)}
    for seed in range(60):
        carrier = radio(seed, **MODE_2, nr_sidelink={"transmissions": 2})
        events: list[LinkEvent] = []
        for tick in range(4):
            carrier.update_environment(RadioEnvironment(places if tick < 2 else {"B": places["B"]}))
            outbox = [(message("A", tick, tick * 0.05, 8000), ["B"])] if tick < 2 else []
            events += carrier.transmit(outbox, tick * 0.05)
        carrier.deliver("B", 1.0)
        assert sorted(event.number for event in events) == [0, 1]
        assert carrier.statistics(1.0)["A", "B"].in_flight == 0


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("nr_sidelink: {interval: 0.15}", "interval is not supported"),
        ("nr_sidelink: {subcarrier_spacing_khz: 60, subchannel_blocks: 15}", "at most 11 in 10 MHz at 60 kHz"),
        ("nr_sidelink: {pscch_blocks: 25}", "pscch_blocks is more than subchannel_blocks"),
        ("nr_sidelink: {subcarrier_spacing_khz: 30, processing: 0.003}", r"at most 0\.0025 s"),
        ("nr_sidelink: {candidate_share: 0.3}", "candidate_share is not supported"),
        ("sidelink: {subchannels: 2}", "sidelink has no effect with technology nr_v2x_mode2"),
        ("background: {kind: cv2x_mode4, density: 0.1, rate: 10, power_dbm: 23}", "background has no effect"),
        ("mtu: 500", "mtu has no effect with technology nr_v2x_mode2"),
    ],
)
def test_setting_outside_the_standard_raises(setting: str, text: str) -> None:
    with pytest.raises(SettingError, match=text):
        load_profile(f"{{model: radio, technology: nr_v2x_mode2, {setting}}}")
