"""Jammers: received power, lost messages by cause, and stations that do not transmit."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError
from radio_traffic import DT, QUIET, exchange, message, radio

from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

FREE = {"path_loss": {"kind": "log_distance", "exponent": 2.0}, "shadowing_db": 0, "line_of_sight": "clear"}
PLACES = {"A": (0.0, 0.0, 1.5), "B": (100.0, 0.0, 1.5)}


def jammer(x: float, power: float) -> dict[str, list[dict[str, float]]]:
    return {"jammers": [{"x": x, "y": 0.0, "power_dbm": power}]}


def test_received_power_is_that_of_friis_and_adds_up() -> None:
    """20 lg(4 pi d f / c) with c = 3e8 m/s: 87.86 dB at 100 m and 5.9 GHz."""
    stations = RadioEnvironment({"A": (100.0, 0.0, 1.5), "B": (200.0, 0.0, 1.5)})
    power = RadioProfile.model_validate({**FREE, **jammer(0.0, 33.0)}).jamming_power(stations)
    loss = 20.0 * math.log10(4.0 * math.pi * 100.0 * 5.9e9 / 3e8)
    assert 10.0 * math.log10(power[0]) == pytest.approx(33.0 + 3.0 - loss)
    assert power[0] / power[1] == pytest.approx(4.0)
    two = {"jammers": 2 * jammer(0.0, 33.0)["jammers"]}
    assert RadioProfile.model_validate({**FREE, **two}).jamming_power(stations) == pytest.approx(2.0 * power)


def test_received_power_is_that_of_the_heights_above_the_ground() -> None:
    """WINNER+ B1 with antennas at 1.5 m on a plateau of 100 m, as on a plain."""
    power = []
    for ground in (0.0, 100.0):
        settings = {"path_loss": {"kind": "winner_b1"}, "jammers": [{"x": 0.0, "y": 0.0, "z": ground + 1.5}]}
        stations = RadioEnvironment({"A": (200.0, 0.0, ground + 1.5)}, grounds={"A": ground})
        power.append(float(RadioProfile.model_validate(settings).jamming_power(stations)[0]))
    assert power[1] == pytest.approx(power[0])
    assert 10.0 * math.log10(power[0]) == pytest.approx(30.0 + 3.0 - 112.1, abs=0.1)


@pytest.mark.parametrize("stations", [2, 6])
def test_signal_to_noise_ratio_decides_on_the_loss(stations: int) -> None:
    """The loss of A's message at B follows the packet error curve at signal over noise plus jamming.

    Stations beyond range make the channel evaluate arrays instead of scalars.
    """
    places = {**PLACES, **{f"Z{i}": (1e6, 1e4 * i, 1.5) for i in range(stations - 2)}}
    lost = {}
    for power in (-20.0, 20.0):
        carrier = radio(1, **FREE, **jammer(140.0, power))
        events, _ = exchange(carrier, places, 40)
        at_b = [event for event in events if (event.sender, event.receiver) == ("A", "B")]
        assert len(at_b) >= 39
        lost[power] = [event.reason for event in at_b if event.outcome == "lost"]
    # Signal at B: 23 + 6 - 87.9 = -58.9 dBm. The jammer at 40 m: -20 + 3 - 79.9 = -96.9 dBm, below the noise of
    # -95 dBm; 20 + 3 - 79.9 = -56.9 dBm, above the signal. At A it has 20 + 3 - 90.8 = -67.8 dBm: A still transmits.
    assert lost[-20.0] == []
    assert set(lost[20.0]) == {"jamming"}
    assert len(lost[20.0]) >= 39


def test_station_near_the_jammer_does_not_transmit() -> None:
    carrier = radio(1, **FREE, **jammer(110.0, 10.0))  # at B 10 + 3 - 67.9 = -54.9 dBm, at A 10 + 3 - 88.7 = -75.7 dBm
    events, _ = exchange(carrier, PLACES, 10)
    assert {event.reason for event in events if event.sender == "B"} == {"queue"}
    assert {event.reason for event in events if event.sender == "A"} == {"jamming"}
    assert carrier.channel_busy_ratio("B") == 1.0
    assert 0.0 < (carrier.channel_busy_ratio("A") or 0.0) < 0.1
    statistics = carrier.statistics(10 * DT)
    assert all(link.sent == link.received + link.lost + link.in_flight for link in statistics.values())
    assert statistics["B", "A"].lost_by == {"queue": 10}


def test_station_that_comes_near_the_jammer_drops_its_queue() -> None:
    """From 1 s on B is near the jammer: its channel is busy all the time, for which table A.1 has 1 s."""
    carrier = radio(1, **FREE, **jammer(1100.0, 10.0), congestion={"kind": "reactive"})
    outcomes = {}
    for tick in range(40):
        x = 100.0 if tick < 20 else 1090.0
        carrier.update_environment(RadioEnvironment({"A": (x - 20.0, 0.0, 1.5), "B": (x, 0.0, 1.5)}))
        outbox = [(message("B", tick, tick * DT), ["A"])] if tick < 20 else []
        outcomes.update({event.number: event for event in carrier.transmit(outbox, tick * DT)})
    assert all(event.arrives is None or event.arrives <= 20 * DT for event in outcomes.values())
    assert {event.reason for event in outcomes.values() if event.outcome == "lost"} == {"queue"}
    assert len(outcomes) == 20
    assert carrier.min_message_interval("B") == 1.0


def test_jammer_that_ends_restores_the_link() -> None:
    jammed = radio(1, **FREE, **jammer(110.0, 10.0))
    exchange(jammed, PLACES, 10)
    clear = radio(1, **FREE)
    clear.continue_from(jammed)
    clear.update_environment(RadioEnvironment(PLACES))
    clear.deliver("A", 10 * DT)
    clear.transmit([(message("B", 10, 10 * DT), ["A"])], 10 * DT)
    assert clear.deliver("A", 11 * DT)
    assert clear.statistics(11 * DT)["B", "A"].received == 1


def test_no_jammer_and_a_distant_one_give_equal_outcomes() -> None:
    far = radio(3, **QUIET, jammers=[{"x": 1e6, "y": 0.0, "power_dbm": -30.0}])
    assert exchange(far, PLACES, 30)[0] == exchange(radio(3, **QUIET), PLACES, 30)[0]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"technology": "cv2x_mode4", **jammer(0.0, 10.0)}, "jammers has no effect with technology cv2x_mode4"),
        (jammer(0.0, 90.0), "less than or equal to 80"),
        ({"jammers": [{"x": 0.0}]}, "y"),
    ],
)
def test_invalid_jammers_are_errors(settings: dict[str, object], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        radio(1, **settings)
