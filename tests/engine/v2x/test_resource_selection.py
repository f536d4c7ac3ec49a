"""Sensing-based resource selection of Mode 4 and Mode 2, with resources counted by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.v2x.radio.sidelink.resource_selection import PSTEP, WINDOW, Request, Sensed, candidates

NOW, BANDS = 5000, 4
REQUEST = Request(
    now=NOW,
    first=NOW + 1,
    last=NOW + 100,
    width=1,
    length=1,
    interval=100,
    uses=100,
    threshold=-128.0,
    share=0.2,
    span=PSTEP,
)
"""100 subframes of 4 subchannels: 400 candidate resources, of which 80 are reported."""


def sensed(
    *,
    rssi: dict[tuple[int, int], float] | None = None,
    own: tuple[int, ...] = (),
    sci: Any = (),
    ahead: int = 0,
    repeats: bool = True,
    bands: int = BANDS,
) -> Sensed:
    """Return sensing results from S-RSSI by (subframe, subchannel), own subframes and decoded SCI.

    sci      rows of (subframe, subchannel, width, RSRP)
    ahead    subframes from each SCI to a transmission of its message
    repeats  whether each SCI also reserves for the next message
    """
    power, monitored = np.zeros((WINDOW, bands), dtype=np.float32), np.ones(WINDOW, dtype=np.bool_)
    for (subframe, band), value in (rssi or {}).items():
        power[subframe % WINDOW, band] = value
    monitored[np.array(own, dtype=np.int64) % WINDOW] = False
    columns = np.array(sci, dtype=float).reshape(-1, 4)
    decoded, first, widths = (columns[:, place].astype(np.int64) for place in range(3))
    unheard = np.array(own, dtype=np.int64)
    rsrp = columns[:, 3].astype(np.float32)
    offsets, periodic = np.full_like(decoded, ahead), np.full_like(decoded, repeats)
    return Sensed(power, monitored, unheard, decoded, offsets, periodic, first, widths, rsrp)


def as_pairs(request: Request, history: Sensed, order: NDArray[np.float64] | None) -> set[tuple[int, int]]:
    """Return the reported resources as (subframe, first subchannel)."""
    places = history.rssi.shape[1] - request.width + 1
    return {(request.first + index // places, index % places) for index in candidates(request, history, order).tolist()}


def reported(request: Request, history: Sensed, seed: int = 1) -> set[tuple[int, int]]:
    """Return the resources that Mode 4 reports."""
    count = request.starts * (history.rssi.shape[1] - request.width + 1)
    return as_pairs(request, history, generator(seed, "order").random(count))


def reported_in_mode_2(request: Request, history: Sensed) -> set[tuple[int, int]]:
    return as_pairs(request, history, None)


def reported_for_any_order(request: Request, history: Sensed) -> set[tuple[int, int]]:
    """Return the resources that are reported for any order of equal ones."""
    return set().union(*(reported(request, history, seed) for seed in range(60)))


def test_candidates_without_history_are_a_fifth_of_all_resources() -> None:
    assert len(reported(REQUEST, sensed())) == 80
    assert reported_for_any_order(REQUEST, sensed()) == {(NOW + 1 + y, x) for y in range(100) for x in range(4)}


def test_candidates_exclude_the_next_use_of_a_decoded_reservation() -> None:
    """SCI in subframe 4950 reserves subchannels 1 and 2 in 5050."""
    left = reported_for_any_order(REQUEST, sensed(sci=[(4950, 1, 2, -100.0)]))
    assert {(5050, x) for x in range(4)} & left == {(5050, 0), (5050, 3)}
    assert len(left) == 398


def test_candidates_ignore_expired_reservations() -> None:
    """SCI in subframe 4850 reserves 4950, which has passed."""
    assert len(reported_for_any_order(REQUEST, sensed(sci=[(4850, 1, 1, -100.0)]))) == 400


@pytest.mark.parametrize(("rsrp", "left"), [(-109.0, 399), (-110.0, 400), (-111.0, 400)])
def test_candidates_include_reservations_up_to_the_rsrp_threshold(rsrp: float, left: int) -> None:
    assert len(reported_for_any_order(replace(REQUEST, threshold=-110.0), sensed(sci=[(4950, 1, 1, rsrp)]))) == left


def test_candidates_exclude_unmonitored_subframes() -> None:
    left = reported_for_any_order(REQUEST, sensed(own=(4930, 4830)))
    assert {subframe for subframe, _ in left} == set(range(5001, 5101)) - {5030}


def test_rsrp_threshold_rises_in_steps_of_3_db_until_a_fifth_remains() -> None:
    """All 400 resources are reserved, subframe y at -120 + 0.5 (y - 5001) dBm.

    The 20th weakest subframe has -110.5 dBm. The lowest threshold of -128, -125, … above it is -110: 21 remain.
    """
    sci = [(4901 + y, 0, 4, -120.0 + 0.5 * y) for y in range(100)]
    assert {subframe for subframe, _ in reported_for_any_order(REQUEST, sensed(sci=sci))} == set(range(5001, 5022))


def test_candidates_have_the_lowest_average_rssi_of_the_last_second() -> None:
    """79 resources are quiet; of the others, one has a mean of 0.5 and is selected before those with 1."""
    quiet = {(5001 + k // 4, k % 4) for k in range(79)}
    rssi = {}
    for y in range(5001, 5101):
        for x in range(4):
            for j in range(1, 11):
                rssi[y - 100 * j, x] = 0.0 if (y, x) in quiet else 1.0
    for j in range(1, 11):
        rssi[5090 - 100 * j, 2] = 5.0 if j == 4 else 0.0
    assert reported(REQUEST, sensed(rssi=rssi)) == quiet | {(5090, 2)}


def test_average_rssi_excludes_unmonitored_subframes() -> None:
    """A resource monitored in 1 of 10 intervals has the mean of this interval, 1, above 0.6 of the others."""
    rssi = {(5001 + y - 100 * j, x): 0.6 for y in range(100) for x in range(4) for j in range(1, 11)}
    rssi |= {(5050 - 100 * j, 0): 1.0 for j in range(1, 11)}
    own = tuple(5050 - 100 * j for j in range(2, 11))
    assert (5050, 0) not in reported_for_any_order(REQUEST, sensed(rssi=rssi, own=own))


def test_candidates_of_short_intervals_use_their_own_period() -> None:
    """At 20 ms, an SCI in 4990 reserves 5010 (q = 1), and its repetitions coincide with the same candidate."""
    request = replace(REQUEST, last=NOW + 20, interval=20)
    left = reported_for_any_order(request, sensed(sci=[(4990, 0, 1, -90.0)]))
    assert {(5001 + y, x) for y in range(20) for x in range(4)} - left == {(5010, 0)}
    rssi = {(5001 + y - 20 * j, x): 1.0 for y in range(20) for x in range(4) for j in range(1, 51) if (y, x) != (7, 3)}
    assert (5008, 3) in reported(request, sensed(rssi=rssi))


def test_candidates_of_long_intervals_exclude_uses_within_the_selection_window() -> None:
    """At 200 ms, an SCI in 4850 reserves 5050; an SCI in 4950 reserves 5150, beyond the window of 100 ms."""
    left = reported_for_any_order(
        replace(REQUEST, interval=200), sensed(sci=[(4850, 0, 1, -90.0), (4950, 1, 1, -90.0)])
    )
    assert {(5001 + y, x) for y in range(100) for x in range(4)} - left == {(5050, 0)}


@pytest.mark.parametrize(("width", "length", "count"), [(2, 1, 300), (4, 1, 100), (4, 3, 98), (1, 120, 4)])
def test_candidates_of_larger_messages_are_contiguous(width: int, length: int, count: int) -> None:
    request = replace(REQUEST, width=width, length=length)
    assert len(reported_for_any_order(request, sensed())) == count
    left = reported_for_any_order(request, sensed(sci=[(4950, 1, 1, -90.0)]))
    blocked = {
        (y, x) for y, x in reported_for_any_order(request, sensed()) if y <= 5050 < y + length and x <= 1 < x + width
    }
    assert left == reported_for_any_order(request, sensed()) - blocked


def test_candidates_without_monitored_subframes_are_not_empty() -> None:
    """A station that transmitted in each subframe of the interval still selects a resource."""
    assert len(reported(REQUEST, sensed(own=tuple(range(4900, 5000))))) == 80


def test_mode_2_reports_all_resources_that_are_not_reserved() -> None:
    """3GPP TS 38.214, 8.1.4: no ranking by power. SCI in 4950 reserves subchannels 1 and 2 of 5050."""
    loud = {(5001 + y - 100 * j, 3): 1.0 for y in range(100) for j in range(1, 11)}
    everything = {(5001 + y, x) for y in range(100) for x in range(4)}
    assert reported_in_mode_2(REQUEST, sensed(rssi=loud)) == everything
    assert reported_in_mode_2(REQUEST, sensed(sci=[(4950, 1, 2, -100.0)])) == everything - {(5050, 1), (5050, 2)}


def test_mode_2_excludes_later_transmissions_of_a_message_once() -> None:
    """SCI in 4990 announces a transmission in 5010; with a window of 20 ms it would repeat in 5030."""
    request = replace(REQUEST, last=NOW + 60, interval=20, span=60)
    everything = {(5001 + y, x) for y in range(60) for x in range(4)}
    announced = sensed(sci=[(4990, 2, 1, -90.0)], ahead=20, repeats=False)
    assert everything - reported_in_mode_2(request, announced) == {(5010, 2)}
    passed = sensed(sci=[(4990, 2, 1, -90.0)], ahead=5, repeats=False)
    assert reported_in_mode_2(request, passed) == everything, "the slot has passed"


@pytest.mark.parametrize(
    ("interval", "slots"), [(100, {5070}), (50, {5020, 5070}), (20, {5010, 5030, 5050, 5070, 5090})]
)
def test_mode_2_excludes_later_transmissions_of_the_next_messages(interval: int, slots: set[int]) -> None:
    """TS 38.214, 8.1.4, step 6c: SCI in 4990 or 4950 of a transmission 20 slots later is assumed again in the next
    intervals, Q = 100 / interval of them, or one if it is older than an interval.
    """
    sci = 4990 if interval == 20 else 4950
    everything = {(5001 + y, x) for y in range(100) for x in range(4)}
    announced = sensed(sci=[(sci, 2, 1, -90.0)], ahead=20)
    reported = reported_in_mode_2(replace(REQUEST, interval=interval), announced)
    assert everything - reported == {(slot, 2) for slot in slots}


@pytest.mark.parametrize(("share", "last"), [(0.2, 5021), (0.35, 5039), (0.5, 5051)])
def test_mode_2_raises_the_threshold_until_the_share_remains(share: float, last: int) -> None:
    """Slot y is reserved at -120 + 0.5 (y - 5001) dBm: thresholds of -110, -101 and -95 dBm leave the share."""
    sci = [(4901 + y, 0, 4, -120.0 + 0.5 * y) for y in range(100)]
    left = reported_in_mode_2(replace(REQUEST, share=share), sensed(sci=sci))
    assert {slot for slot, _ in left} == set(range(5001, last + 1))


def test_mode_2_uses_unmonitored_slots_if_too_few_were_monitored() -> None:
    """Step 5a: own transmissions do not exclude if less than the share would remain; reservations still do."""
    own = tuple(range(4900, 4990))
    assert {slot for slot, _ in reported_in_mode_2(REQUEST, sensed(own=own))} == set(range(5001, 5101))
    left = reported_in_mode_2(REQUEST, sensed(own=own, sci=[(4950, 1, 1, -90.0)]))
    assert {(5001 + y, x) for y in range(100) for x in range(4)} - left == {(5050, 1)}
    assert {slot for slot, _ in reported_in_mode_2(REQUEST, sensed(own=own[:70]))} == set(range(5070, 5101))
