"""Both analytic models against golden numbers, and what must hold whatever the numbers are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.settings import parse_settings
from eidrive_scenario.v2x.analytic.cv2x_mode4 import cv2x_mode4_errors
from eidrive_scenario.v2x.analytic.ieee80211p import airtime, ieee80211p_errors
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "v2x_analytic_models.json").read_text(encoding="utf-8"))
DISTANCE = np.array(GOLDEN["distance_m"], dtype=float)
CAUSES = {"err_sen": "sensing", "err_rxb": "busy", "err_pro": "propagation", "err_col": "collision"}
TOLERANCE = 1e-3


@pytest.mark.parametrize("golden", GOLDEN["ieee80211p"], ids=lambda g: f"{g['veh_per_m']}-{g['rate_hz']}-{g['bytes']}")
def test_802_11p_gives_the_golden_curves(golden: dict[str, Any]) -> None:
    table = ieee80211p_errors(
        DISTANCE,
        density=golden["veh_per_m"],
        rate=golden["rate_hz"],
        size=golden["bytes"],
        power=golden["ptx_dbm"],
        bit_rate=golden["rate_bps"],
    )
    assert table.channel_busy_ratio == pytest.approx(golden["cbr"], abs=TOLERANCE)
    assert table.delivery_ratio == pytest.approx(golden["pdr"], abs=TOLERANCE)
    for key, cause in CAUSES.items():
        assert table.errors[cause] == pytest.approx(golden[key], abs=TOLERANCE), cause


@pytest.mark.parametrize("golden", GOLDEN["cv2x_mode4"], ids=lambda g: f"{g['veh_per_m']}-{g['rate_hz']}")
def test_c_v2x_mode_4_gives_the_golden_curves(golden: dict[str, Any]) -> None:
    table = cv2x_mode4_errors(
        DISTANCE,
        density=golden["veh_per_m"],
        rate=golden["rate_hz"],
        power=golden["ptx_dbm"],
        subchannels=golden["subch"],
    )
    assert table.channel_busy_ratio == pytest.approx(golden["cbr"], abs=TOLERANCE)
    assert table.delivery_ratio == pytest.approx(golden["pdr"], abs=TOLERANCE)
    assert table.errors["half_duplex"] == pytest.approx(golden["err_hd"], abs=TOLERANCE)
    for key, cause in CAUSES.items():
        if key in golden:
            assert table.errors[cause] == pytest.approx(golden[key], abs=TOLERANCE), cause


def test_more_vehicles_cost_delivery_at_every_distance() -> None:
    sparse, dense = (Ieee80211pLoss(kind="80211p", density=density).table() for density in (0.03, 0.12))
    assert np.all(dense.delivery_ratio <= sparse.delivery_ratio)
    assert dense.channel_busy_ratio > sparse.channel_busy_ratio
    sparse, dense = (Cv2xMode4Loss(kind="cv2x_mode4", density=density).table() for density in (0.1, 0.3))
    assert np.all(dense.delivery_ratio <= sparse.delivery_ratio)
    assert dense.channel_busy_ratio > sparse.channel_busy_ratio


@pytest.mark.parametrize(
    "settings",
    [
        {"kind": "80211p", "density": 1e-4, "rate": 0.1, "size": 10},
        {"kind": "80211p", "density": 0.3, "rate": 10, "size": 300},
        {"kind": "80211p", "density": 0.0065, "rate": 1000, "size": 190},
        {"kind": "80211p", "density": 1.0, "rate": 1, "size": 1500},
        {"kind": "cv2x_mode4", "density": 1e-4, "rate": 1},
        {"kind": "cv2x_mode4", "density": 0.2, "rate": 25},
        {"kind": "cv2x_mode4", "density": 1.0, "rate": 2},
    ],
    ids=str,
)
def test_whatever_the_models_take_they_give_probabilities(settings: dict[str, Any]) -> None:
    model = Ieee80211pLoss if settings["kind"] == "80211p" else Cv2xMode4Loss
    table = model.model_validate(settings).table()
    assert 0.0 <= table.channel_busy_ratio <= 0.85
    for probability in [*table.errors.values(), table.delivery_ratio]:
        assert probability.min() >= -1e-9
        assert probability.max() <= 1.0 + 1e-9


def test_more_than_the_models_can_tell_of_is_refused() -> None:
    """The fit of the busy ratio of 802.11p turns down at 0.913 / (2 · 0.2481) times the channel: 0.3 cars per meter, 25
    messages a second and 2.08 ms for each, over the 584 m in which one is sensed, are 9.1. Mode 4 needs a fifth to
    choose from."""
    with pytest.raises(ValueError, match=r"need 9\.1\d* times the time there is; the model holds up to 1.84: lower"):
        Ieee80211pLoss(kind="80211p", density=0.3, rate=25, size=1500)
    with pytest.raises(ValueError, match=r"keep 0.8\d* of the resources, and the model holds while 0.2 are left"):
        Cv2xMode4Loss(kind="cv2x_mode4", density=0.23, rate=25)


def test_causes_share_the_draw_in_their_order() -> None:
    """Draws spread evenly over (0, 1) meet each cause as often as the table says, and none as often as it delivers."""
    table = Ieee80211pLoss(kind="80211p", density=0.12, rate=25, size=500).table()
    draws = (np.arange(20000) + 0.5) / 20000
    met = [table.cause(150.0, float(draw)) for draw in draws]
    place = list(table.distance).index(150.0)
    for cause, probability in table.errors.items():
        assert met.count(cause) / 20000 == pytest.approx(probability[place], abs=1e-4)
    assert met.count(None) / 20000 == pytest.approx(table.delivery_ratio[place], abs=1e-4)
    assert table.cause(5000.0, 0.999) == "sensing"


def test_airtime_of_the_model() -> None:
    """40 µs and (B + 30) bytes at 6 Mbit/s: 220 · 8 / 6 = 293.33 µs."""
    assert airtime(190, 6e6) == pytest.approx(333.333e-6, abs=1e-9)


@pytest.mark.parametrize("power", [-31.0, 51.0, 1000.0, 1e308])
@pytest.mark.parametrize("kind", ["80211p", "cv2x_mode4"])
def test_model_with_power_beyond_that_of_the_radio_is_refused(kind: str, power: float) -> None:
    model = Ieee80211pLoss if kind == "80211p" else Cv2xMode4Loss
    with pytest.raises(SettingError, match="'power_dbm'"):
        parse_settings(model, {"kind": kind, "density": 0.06, "power_dbm": power})


def test_model_of_cv2x_with_more_packets_than_subframes_is_refused() -> None:
    with pytest.raises(SettingError, match="'rate' is 1001"):
        parse_settings(Cv2xMode4Loss, {"kind": "cv2x_mode4", "density": 0.06, "rate": 1001})
