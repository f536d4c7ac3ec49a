"""Analytic models: comparison with reference values, and general properties."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.v2x.analytic.cv2x_mode4 import cv2x_mode4_errors
from eidrive_scenario.v2x.analytic.ieee80211p import airtime, ieee80211p_errors
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "v2x_analytic_models.json").read_text(encoding="utf-8"))
DISTANCE = np.array(GOLDEN["distance_m"], dtype=float)
CAUSES = {"err_sen": "sensing", "err_rxb": "busy", "err_pro": "propagation", "err_col": "collision"}
TOLERANCE = 1e-3


@pytest.mark.statistical
@pytest.mark.parametrize("golden", GOLDEN["ieee80211p"], ids=lambda g: f"{g['veh_per_m']}-{g['rate_hz']}-{g['bytes']}")
def test_ieee80211p_errors_equal_reference_curves(golden: dict[str, Any]) -> None:
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
def test_cv2x_mode4_errors_equal_reference_curves(golden: dict[str, Any]) -> None:
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


def test_delivery_ratio_falls_with_density_at_every_distance() -> None:
    sparse, dense = (Ieee80211pLoss(kind="80211p", density=density).table() for density in (0.03, 0.12))
    assert np.all(dense.delivery_ratio <= sparse.delivery_ratio)
    assert dense.channel_busy_ratio > sparse.channel_busy_ratio
    sparse, dense = (Cv2xMode4Loss(kind="cv2x_mode4", density=density).table() for density in (0.1, 0.3))
    assert np.all(dense.delivery_ratio <= sparse.delivery_ratio)
    assert dense.channel_busy_ratio > sparse.channel_busy_ratio


@pytest.mark.statistical
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
def test_analytic_models_return_probabilities_over_their_range(settings: dict[str, Any]) -> None:
    model = Ieee80211pLoss if settings["kind"] == "80211p" else Cv2xMode4Loss
    table = model.model_validate(settings).table()
    assert 0.0 <= table.channel_busy_ratio <= 0.85
    for probability in [*table.errors.values(), table.delivery_ratio]:
        assert probability.min() >= -1e-9
        assert probability.max() <= 1.0 + 1e-9


def test_analytic_models_beyond_their_range_raise() -> None:
    """The fit of 802.11p decreases beyond an offered load of 0.913 / (2 · 0.2481).

    Mode 4 requires a fifth of the resources as candidates. 0.3 cars per meter, 25 messages per second of 2.08 ms each,
    sensed over 584 m, are an offered load of 9.1.
    """
    with pytest.raises(ValueError, match=r"offered load .*\(got 9\.1\d*; expected at most 1.84\)"):
        Ieee80211pLoss(kind="80211p", density=0.3, rate=25, size=1500)
    with pytest.raises(ValueError, match=r"reserved share .*\(got 0.8\d*; expected at most 0.8\)"):
        Cv2xMode4Loss(kind="cv2x_mode4", density=0.23, rate=25)


def test_error_table_cause_has_the_probabilities_of_the_table() -> None:
    """Equidistant draws over (0, 1) select each cause, and delivery, with its probability."""
    table = Ieee80211pLoss(kind="80211p", density=0.12, rate=25, size=500).table()
    draws = (np.arange(20000) + 0.5) / 20000
    causes = [table.cause(150.0, float(draw)) for draw in draws]
    place = list(table.distance).index(150.0)
    for cause, probability in table.errors.items():
        assert causes.count(cause) / 20000 == pytest.approx(probability[place], abs=1e-4)
    assert causes.count(None) / 20000 == pytest.approx(table.delivery_ratio[place], abs=1e-4)
    assert table.cause(5000.0, 0.999) == "sensing"


def test_airtime_of_the_analytic_model() -> None:
    """40 µs and (B + 30) bytes at 6 Mbit/s: 220 · 8 / 6 = 293.33 µs."""
    assert airtime(190, 6e6) == pytest.approx(333.333e-6, abs=1e-9)


@pytest.mark.parametrize("power", [-31.0, 51.0, 1000.0, 1e308])
@pytest.mark.parametrize("kind", ["80211p", "cv2x_mode4"])
def test_analytic_loss_with_power_out_of_range_raises(kind: str, power: float) -> None:
    model = Ieee80211pLoss if kind == "80211p" else Cv2xMode4Loss
    with pytest.raises(SettingError, match="'power_dbm'"):
        parse_settings(model, {"kind": kind, "density": 0.06, "power_dbm": power})


def test_cv2x_mode4_loss_with_more_packets_than_subframes_raises() -> None:
    with pytest.raises(SettingError, match="'rate' is 1001"):
        parse_settings(Cv2xMode4Loss, {"kind": "cv2x_mode4", "density": 0.06, "rate": 1001})
