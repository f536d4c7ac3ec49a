"""C-V2X Mode 4: channel busy ratio and congestion control."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from radio_traffic import DT, exchange, message, radio
from sidelink_traffic import MODE_4, TWO, Air, many

from eidrive_scenario.v2x.radio.sidelink.medium import Sidelink
from eidrive_scenario.v2x.radio_environment import RadioEnvironment


@pytest.mark.statistical
@pytest.mark.parametrize(("rate", "size"), [(1, 190), (1, 760), (5, 190), (2, 400)])
def test_busy_ratio_is_the_occupancy_of_subchannels(rate: int, size: int) -> None:
    """The ratio that 40 stations measure agrees with the used subchannels in their measured subframes."""
    places = many(40)
    air = Air(radio(2, **MODE_4, sidelink={"interval": 0.1}), places, 0.1, listeners=0)
    air.run(8.0, dict.fromkeys(places, rate), (size,))
    ratios = [air.carrier.channel_busy_ratio(name) for name in places]
    assert ratios == pytest.approx([air.occupancy(0.0, 7.9)] * 40, abs=0.02)


def test_busy_ratio_counts_used_subchannels_not_subframes() -> None:
    """A message of 190 bytes occupies one of four subchannels for 1 ms; at 10 Hz this is 0.25 % of the channel."""
    carrier = radio(1, **MODE_4)
    exchange(carrier, TWO, 400, sizes=(190,), dt=0.1)
    for name in TWO:
        assert carrier.channel_busy_ratio(name) == pytest.approx(0.0025, rel=0.05)


def test_busy_ratio_ignores_signals_below_the_threshold() -> None:
    far = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5), "C": (90000.0, 0.0, 1.5)}
    carrier = radio(1, **MODE_4)
    exchange(carrier, far, 100, sizes=(190,), dt=0.1)
    assert carrier.channel_busy_ratio("C") == 0.0
    assert (carrier.channel_busy_ratio("B") or 0.0) == pytest.approx(0.0025, rel=0.1)


@pytest.mark.parametrize(("threshold", "ratio", "interval"), [(-101.1, 1.0, 1.0), (-100.9, 0.0025, 0.1)])
def test_busy_ratio_with_threshold_below_noise_is_one(threshold: float, ratio: float, interval: float) -> None:
    """S-RSSI includes the noise (TS 36.214): -95 dBm in 10 MHz, -101.02 dBm in one of four subchannels."""
    carrier = radio(1, **MODE_4, sidelink={"cbr_threshold_dbm": threshold}, congestion={"kind": "reactive"})
    exchange(carrier, TWO, 100, sizes=(190,), dt=0.1)
    for name in TWO:
        assert carrier.channel_busy_ratio(name) == pytest.approx(ratio, rel=0.1)
        assert carrier.min_message_interval(name) == interval


def test_busy_ratio_of_a_single_station_is_zero() -> None:
    carrier = radio(1, **MODE_4)
    for tick in range(100):
        carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5)}))
        carrier.transmit([(message("A", tick, DT * tick, 190), [])], DT * tick)
    assert carrier.channel_busy_ratio("A") == 0.0
    assert isinstance(carrier._access, Sidelink)


@pytest.mark.parametrize(("kind", "period"), [("reactive", 0.1), ("limeric", 0.2)])
def test_congestion_control_receives_the_occupancy_of_its_last_period(kind: str, period: float) -> None:
    places = many(40)
    profile = {**MODE_4, "queue": {"discipline": "lcfs"}, "congestion": {"kind": kind}}
    air = Air(radio(3, **profile, sidelink={"interval": 0.05}), places, listeners=0).run(0.05, {})
    gate = air.carrier._access.gate
    measured: list[NDArray[np.float64]] = []
    control = gate.update

    def update(busy: NDArray[np.float64]) -> None:
        measured.append(busy)
        control(busy)

    gate.update = update  # type: ignore[method-assign]
    air.run(4.0, dict.fromkeys(places, 1), (190, 760, 380))
    for count, busy in enumerate(measured[: round(3.8 / period)]):
        assert busy == pytest.approx([air.occupancy(period * count, period * (count + 1))] * 40, abs=0.03)
    assert np.mean(measured) > 0.1


@pytest.mark.parametrize(("size", "channel_time"), [(190, 0.25e-3), (760, 1e-3), (1500, 2e-3)])
def test_limeric_interval_depends_on_the_channel_time_of_a_message(size: int, channel_time: float) -> None:
    """The minimum interval is duration times share of the subchannels, divided by the share of the station."""
    profile = {**MODE_4, "congestion": {"kind": "limeric", "share_max": 0.002, "share_min": 0.002}}
    air = Air(radio(3, **profile), TWO).run(1.0, {"A": 2}, (size,))
    assert air.carrier.min_message_interval("A") == pytest.approx(channel_time / 0.002)


def test_reactive_dcc_follows_the_busy_ratio_of_subchannels() -> None:
    """60 stations at 20 Hz offer 30 % of the subchannels; at 10 Hz, the maximum below 30 %, they use 15 %."""
    places = many(60)
    profile = {**MODE_4, "queue": {"discipline": "lcfs"}, "sidelink": {"interval": 0.05}}
    free, held = (
        Air(radio(3, **profile, congestion={"kind": kind}), places, listeners=0).run(6.0, dict.fromkeys(places, 1))
        for kind in ("none", "reactive")
    )
    assert free.occupancy(2.0, 5.9) == pytest.approx(0.3, abs=0.02)
    assert held.occupancy(2.0, 5.9) == pytest.approx(0.15, abs=0.02)
    assert {held.carrier.min_message_interval(name) for name in places} == {0.1}
