"""Comparison of many simulated stations with ns-3 (802.11p) and WiLabV2Xsim (Mode 4, Mode 2): PDR over distance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from radio_traffic import message, radio

from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.events import ReceptionBlock
from eidrive_scenario.v2x.radio.packet_error import CURVES, ErrorCurve
from eidrive_scenario.v2x.radio.resource_pool import NrSidelinkSettings
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

DATA = Path(__file__).parents[2] / "data"
NS3 = json.loads((DATA / "ns3_80211p_load.json").read_text(encoding="utf-8"))
WILAB = json.loads((DATA / "wilab_sidelink_prr.json").read_text(encoding="utf-8"))
LENGTH, PERIOD = 2000.0, 0.1
ROAD: dict[str, Any] = {
    "tx_power_dbm": 23,
    "antenna_gain_dbi": 0,
    "path_loss": {"kind": "log_distance", "exponent": 2.5},
    "line_of_sight": "clear",
    "shadowing_db": 0,
}


def delivery_ratios(
    carrier: RadioChannel,
    places: NDArray[np.float64],
    size: int,
    classes: NDArray[np.float64],
    *,
    seconds: float,
    counted_from: float,
    speeds: NDArray[np.float64] | None = None,
    phases: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the PDR by distance class [m] of stations that send `size` bytes in each period, from a time on [s].

    places  (N, 2) at the start [m];  speeds  (N,) along the road, which is closed [m/s];  phases  (N,) of the messages
    """
    names = [f"{row:04d}" for row in range(len(places))]
    counts = np.zeros((2, len(classes) - 1))
    for period in range(round(seconds / PERIOD)):
        now = period * PERIOD
        along = (places[:, 0] + (0.0 if speeds is None else speeds * now)) % LENGTH
        apart = np.hypot(along[:, None] - along, places[:, 1, None] - places[:, 1])
        positions = zip(names, along.tolist(), places[:, 1].tolist(), strict=True)
        carrier.update_environment(RadioEnvironment({name: (x, y, 1.5) for name, x, y in positions}))
        outbox = []
        for row, name in enumerate(names):
            near = np.flatnonzero((apart[row] < classes[-1]) & (np.arange(len(names)) != row))
            sent = msgspec.structs.replace(
                message(name, period, now, size), offset=0.0 if phases is None else float(phases[row])
            )
            outbox.append((sent, [names[other] for other in near.tolist()]))
        for block in carrier.transmit(outbox, now).parts:  # type: ignore[attr-defined]
            if isinstance(block, ReceptionBlock) and now >= counted_from:
                distance = apart[block.senders, block.reached_receivers]
                counts[0] += np.histogram(distance, classes)[0]
                counts[1] += np.histogram(distance[block.causes == 0], classes)[0]
    ratios: NDArray[np.float64] = counts[1] / counts[0]
    return ratios


@pytest.mark.statistical
@pytest.mark.parametrize("per_km", [50, 100, 200])
def test_80211p_delivery_ratio_under_load_agrees_with_ns3(per_km: int) -> None:
    """Hidden stations and equal backoffs, with the packet error model, AIFS and sensing of ns-3."""
    places = np.stack([np.arange(0.0, LENGTH, 1000.0 / per_km), np.zeros(round(LENGTH * per_km / 1000.0))], axis=1)
    expected = np.array(NS3[str(per_km)])
    carrier = radio(1, **ROAD, jitter=PERIOD, noise_dbm=-96.975, sensing_dbm=-85, packet_errors="80211p_nist")
    classes = NS3["class_m"] * np.arange(len(expected) + 1.0) - 1e-6
    ratios = delivery_ratios(carrier, places, NS3["bytes_on_air"], classes, seconds=4.0, counted_from=1.0)
    assert ratios == pytest.approx(expected, abs=0.04)


@pytest.mark.statistical
@pytest.mark.parametrize("case", WILAB["cases"], ids=lambda case: f"{case['technology']} {case['per_km']}")
def test_sidelink_delivery_ratio_agrees_with_wilabv2xsim(case: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """With the packet errors of WiLabV2Xsim, and its fixed threshold of the SCI.

    The first seconds, before stations have selected resources by sensing all others, are not counted.
    """
    steps = (WILAB["sci_threshold_db"] - 1e-3, WILAB["sci_threshold_db"])
    control = ErrorCurve(steps, (1.0, 0.0), None, "threshold")
    ratios, errors = zip(*case["errors"], strict=True)
    monkeypatch.setitem(CURVES, "data", ErrorCurve(ratios, errors, None, "WiLabV2Xsim"))
    monkeypatch.setitem(CURVES, "control", control)
    monkeypatch.setattr(NrSidelinkSettings, "control_curve", control)
    pool = {"resource_keep_probability": 0.4, "pssch_rsrp_threshold_dbm": -126}
    pools: dict[str, dict[str, Any]] = {
        "LTE-V2X": {
            "technology": "cv2x_mode4",
            "sensing_dbm": -130,
            "sidelink": {**pool, "subchannels": 2, "subchannel_bytes": case["bytes"], "pscch_errors": "control"},
        },
        "5G-V2X": {
            "technology": "nr_v2x_mode2",
            "nr_sidelink": {**pool, "transmissions": case.get("transmissions", 1)},
        },
    }
    settings: dict[str, Any] = {**ROAD, **pools[case["technology"]], "jitter": 0, "packet_errors": "data"}
    count = round(LENGTH * case["per_km"] / 1000.0)
    classes = WILAB["class_m"] * np.arange(len(case["prr"]) + 1.0)
    simulated = []
    for seed in range(2):
        random = np.random.default_rng(seed)
        lanes = random.integers(0, 6, count)
        places = np.stack([random.uniform(0.0, LENGTH, count), 3.5 * lanes], axis=1)
        speeds = np.where(lanes < 3, 1.0, -1.0) * 100.0 / 3.6
        phases = random.uniform(0.0, PERIOD, count)
        carrier = radio(seed, **settings, queue={"discipline": "lcfs"})
        traffic = {"speeds": speeds, "phases": phases, "seconds": 10.0, "counted_from": 5.0}
        simulated.append(delivery_ratios(carrier, places, case["bytes"], classes, **traffic))
    assert np.mean(simulated, axis=0) == pytest.approx(np.array(case["prr"]), abs=0.015)
