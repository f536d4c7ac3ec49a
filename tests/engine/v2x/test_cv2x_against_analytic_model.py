"""Comparison of simulated C-V2X Mode 4 with the analytic model of Gonzalez-Martín et al. (IEEE TVT 2019).

Stations on a straight road of 2 km each send 10 messages of 190 bytes per second; the middle 600 m are evaluated. The
settings match the assumptions of the model: WINNER+ B1 with antennas of 1.5 m and an environment height of 0 m,
shadowing of 3 dB, QPSK 0.7, 20 dBm without antenna gain, sensing and channel busy ratio from -90.5 dBm.

Differences: the control channel of the simulation can fail. The simulation also measures S-RSSI below -90.5 dBm, so
that stations avoid resources of stations that they do not decode. The shadowing of a link of stationary stations is
constant.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from radio_traffic import message, radio

from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.events import ReceptionBlock
from eidrive_scenario.v2x.radio.reception import CAUSES
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

pytestmark = pytest.mark.exhaustive

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "v2x_analytic_models.json").read_text(encoding="utf-8"))
DISTANCES = (100, 200, 300)
LENGTH, MIDDLE = 2000.0, 600.0
DT, WARM_UP, END = 0.02, 3.0, 7.0
SENSED = -90.5
PROFILE: dict[str, Any] = {
    "technology": "cv2x_mode4",
    "frequency_ghz": 5.91,
    "tx_power_dbm": 20,
    "antenna_gain_dbi": 0,
    "path_loss": {"kind": "winner_b1", "environment_height": 0},
    "shadowing_db": 3,
    "line_of_sight": "clear",
    "jitter": 0,
    "queue": {"discipline": "lcfs"},
    "sidelink": {"cbr_threshold_dbm": SENSED},
}


@dataclass
class Counts:
    """Outcomes by distance and channel busy ratios, measured and counted, of the evaluated stations after warm-up."""

    outcomes: dict[int, Counter[str]] = field(default_factory=lambda: {distance: Counter() for distance in DISTANCES})
    channel_busy_ratio: float = 0.0
    occupancy: float = 0.0

    def ratio(self, cause: str, distance: int) -> float:
        return self.outcomes[distance][cause] / self.outcomes[distance].total()

    def __add__(self, other: Counts) -> Counts:
        outcomes = {distance: self.outcomes[distance] + other.outcomes[distance] for distance in DISTANCES}
        return Counts(
            outcomes,
            (self.channel_busy_ratio + other.channel_busy_ratio) / 2.0,
            (self.occupancy + other.occupancy) / 2.0,
        )


def simulate(density: float, seed: int) -> Counts:
    count = round(LENGTH * density)
    along = (np.arange(count) + 0.5) / density
    middle = np.flatnonzero(np.abs(along - LENGTH / 2.0) < MIDDLE / 2.0)
    names = [f"{row:04d}" for row in range(count)]
    apart = np.abs(along[:, None] - along)
    near = [[] if row not in middle else middle[(apart[row, middle] < 310) & (middle != row)] for row in range(count)]
    receivers = [[names[other] for other in others] for others in near]
    phase = np.random.default_rng(seed).integers(0, 5, count)
    carrier = radio(seed, **PROFILE)
    carrier.update_environment(
        RadioEnvironment({name: (float(x), 0.0, 1.5) for name, x in zip(names, along, strict=True)})
    )
    sent: list[Transmission] = []
    counts = Counts()
    before: list[float] = []
    for tick in range(round(END / DT)):
        now = tick * DT
        if not before and now >= WARM_UP:
            before = [now * (carrier.channel_busy_ratio(names[row]) or 0.0) for row in middle]
            since = now
        outbox = [
            (message(names[row], tick // 5, now, 190), receivers[row]) for row in np.flatnonzero(phase == tick % 5)
        ]
        for block in carrier.transmit(outbox, now).parts:  # type: ignore[attr-defined]
            if isinstance(block, ReceptionBlock) and now >= WARM_UP:
                sent += block.ended
                distance = apart[block.senders, block.reached_receivers]
                for one, outcomes in counts.outcomes.items():
                    at = np.abs(distance - one) <= 0.5 / density + 1e-6
                    outcomes.update(CAUSES[code] for code in block.causes[at].tolist())
    after = [now * (carrier.channel_busy_ratio(names[row]) or 0.0) for row in middle]
    counts.channel_busy_ratio = float(np.mean(np.array(after) - before)) / (now - since)
    loss = carrier._budget.loss  # type: ignore[union-attr]
    counts.occupancy = float(np.mean([occupied(sent, 20.0 - loss[:, row], row, since, now) for row in middle[::15]]))
    return counts


def occupied(sent: list[Transmission], power: Any, row: int, since: float, until: float) -> float:
    """Return the share of resources whose total power a station can sense in subframes without own transmission."""
    total: defaultdict[tuple[int, int], float] = defaultdict(float)
    own = set()
    for entry in sent:
        sender, subframe = int(entry.message.sender), round(1000 * entry.start)
        if since <= entry.start < until - 0.001:
            if sender == row:
                own.add(subframe)
            else:
                total[subframe, entry.first_band] += 10.0 ** (power[sender] / 10.0)
    used = sum(signal > 10.0 ** (SENSED / 10.0) for (subframe, _), signal in total.items() if subframe not in own)
    return float(used) / (4 * (1000 * (until - since) - len(own)))


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("golden", GOLDEN["cv2x_mode4"], ids=lambda golden: str(golden["veh_per_m"]))
def test_mode_4_delivery_ratio_agrees_with_the_analytic_model(golden: dict[str, Any]) -> None:
    """One run at 0.3 vehicles per meter has more links than both at 0.1."""
    counts = simulate(golden["veh_per_m"], seed=1)
    if golden["veh_per_m"] < 0.3:
        counts += simulate(golden["veh_per_m"], seed=2)
    expected = dict(zip(GOLDEN["distance_m"], golden["pdr"], strict=True))
    for distance in DISTANCES:
        assert counts.ratio(CAUSES[0], distance) == pytest.approx(expected[distance], abs=0.05), distance
        assert counts.ratio("collision", distance) > 0.0
    everywhere = sum(counts.outcomes.values(), Counter())
    assert everywhere["half_duplex"] / everywhere.total() == pytest.approx(0.01, abs=0.006)
    assert counts.channel_busy_ratio == pytest.approx(counts.occupancy, abs=0.02)
    assert counts.channel_busy_ratio == pytest.approx(golden["cbr"], abs=0.02)
