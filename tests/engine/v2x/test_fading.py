"""Fast fading: distribution, and effect on reception and carrier sensing."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from radio_traffic import exchange, message, radio

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.propagation import Nakagami
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

QUIET = {"shadowing_db": 0, "line_of_sight": "clear", "path_loss": {"kind": "log_distance", "exponent": 2.5}}
DRAWS = (np.arange(200_000) + 0.5) / 200_000


@pytest.mark.parametrize("m", [0.5, 1.0, 3.0, 20.0])
def test_nakagami_power_has_mean_1_and_variance_1_over_m(m: float) -> None:
    power = 10.0 ** (Nakagami(kind="nakagami", m=(m,)).gain_db(np.zeros(len(DRAWS)), DRAWS) / 10.0)
    assert power.mean() == pytest.approx(1.0, abs=1e-3)
    assert power.var() == pytest.approx(1.0 / m, rel=5e-3)


def test_nakagami_gain_with_m_1_is_rayleigh_fading() -> None:
    """The power is exponential: -ln(1 - u)."""
    gain = Nakagami(kind="nakagami", m=(1.0,)).gain_db(np.zeros(3), np.array([0.1, 0.5, 0.9]))
    assert gain == pytest.approx(10.0 * np.log10(-np.log([0.9, 0.5, 0.1])))


def test_nakagami_shape_follows_the_distance() -> None:
    """Default of ns-3: 1.5 below 80 m, 0.75 from 80 m."""
    fading = Nakagami(kind="nakagami", m=(1.5, 0.75), distances=(80.0,))
    one, other = (Nakagami(kind="nakagami", m=(m,)) for m in (1.5, 0.75))
    distance, draws = np.array([0.0, 79.9, 80.0, 500.0]), np.full(4, 0.1)
    near, far = one.gain_db(distance, draws), other.gain_db(distance, draws)
    assert fading.gain_db(distance, draws) == pytest.approx([*near[:2], *far[2:]])


@pytest.mark.parametrize(
    "invalid",
    [{"m": 0.4}, {"m": [1, 2]}, {"m": 1, "distances": [80]}, {"m": [1, 2, 3], "distances": [200, 80]}, {}, {"m": "a"}],
)
def test_nakagami_invalid_settings_raise(invalid: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        RadioProfile.model_validate({"fading": {"kind": "nakagami", **invalid}})


@pytest.mark.exhaustive
@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4"])
def test_fading_changes_the_signal_of_each_message_and_not_the_path_loss(technology: str) -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (100.0, 0.0, 1.5)}
    carrier = radio(1, technology=technology, fading={"kind": "nakagami", "m": 1}, **QUIET)
    carrier.update_environment(RadioEnvironment(places))
    events: list[LinkEvent] = []
    for number in range(2000):
        events += carrier.transmit([(message("A", number, 0.1 * number, 190), ["B"])], 0.1 * number)
    assert len({event.path_loss_db for event in events}) == 1
    noise = carrier.profile.noise
    mean = carrier.profile.radiated - (events[0].path_loss_db or 0.0) - noise
    power = 10.0 ** ((np.array([event.snr_db for event in events], dtype=float) - mean) / 10.0)
    assert power.mean() == pytest.approx(1.0, abs=0.06)
    assert np.mean(power < np.log(2.0)) == pytest.approx(0.5, abs=0.03)


def test_fading_applies_to_carrier_sensing() -> None:
    """With a mean power 3 dB below the threshold, Rayleigh fading lifts e^-2 = 13.5 % of the messages above it."""
    places = {"A": (0.0, 0.0, 1.5), "B": (100.0, 0.0, 1.5)}
    mean = 29.0 - (47.8588 + 50.0)
    carrier = radio(1, fading={"kind": "nakagami", "m": 1}, sensing_dbm=mean + 3.0103, **QUIET)
    carrier.update_environment(RadioEnvironment(places))
    for number in range(3000):
        carrier.transmit([(message("A", number, 0.1 * number, 300), [])], 0.1 * number)
    assert (carrier.channel_busy_ratio("B") or 0.0) / (carrier.channel_busy_ratio("A") or 1.0) == pytest.approx(
        np.exp(-2.0), rel=0.1
    )


def test_fading_does_not_change_other_random_numbers() -> None:
    """Shadowing and start of each message are equal with and without fading."""
    places = {name: (40.0 * row, 0.0, 1.5) for row, name in enumerate("ABCD")}
    path = {"kind": "tr37885"}
    runs = [
        exchange(radio(3, fading=fading, path_loss=path, sensing_dbm=-200.0), places, 30, speed=5.0)[0]
        for fading in ({"kind": "none"}, {"kind": "nakagami", "m": 2})
    ]
    losses = [{(e.sender, e.receiver, e.number): e.path_loss_db for e in events} for events in runs]
    assert losses[0] == losses[1]
    assert {e.snr_db for e in runs[0]} != {e.snr_db for e in runs[1]}
