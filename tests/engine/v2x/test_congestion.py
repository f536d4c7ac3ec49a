"""Congestion control: reactive table, and fixed points of LIMERIC."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.v2x.radio.congestion import DccGate, Limeric, NoDcc, ReactiveDcc


@pytest.mark.parametrize(("stations", "busy"), [(25, 0.4435), (50, 0.5368), (100, 0.6000), (200, 0.6375)])
def test_limeric_converges_to_its_fixed_point(stations: int, busy: float) -> None:
    """Fixed point share = 0.000816 / (0.016 + 0.0012 K), busy ratio = K share, from both ends of the range."""
    control = Limeric(kind="limeric")
    for start in (control.share_min, control.share_max):
        gate = DccGate(control, 1)
        gate.share[:] = start
        for _ in range(600):
            gate.update(np.minimum(1.0, stations * gate.share))
        assert stations * gate.share[0] == pytest.approx(busy, abs=1e-4)
        assert gate.share[0] == pytest.approx(0.000816 / (0.016 + 0.0012 * stations), rel=1e-3)


def test_dcc_gate_starts_in_the_steady_state_of_the_background() -> None:
    """Idle: 0.0005 / 0.016 exceeds the maximum share. 60 % busy: 0.0012 · 0.08 / 0.016. 77 % busy: minimum."""
    limeric = Limeric(kind="limeric")
    shares = [DccGate(limeric, 1, busy).share[0] for busy in (0.0, 0.6, 0.77)]
    assert shares == pytest.approx([0.03, 0.006, 0.0006])
    for busy in (0.0, 0.6, 0.77):
        gate = DccGate(limeric, 1, busy)
        for _ in range(50):
            gate.update(np.zeros(1))
        assert gate.share[0] == pytest.approx(limeric.steady_share(busy)), "the background alone is a steady state"
    assert DccGate(ReactiveDcc(kind="reactive"), 1, 0.45).interval(0, 0.001) == 0.4


def test_limeric_keeps_intervals_within_their_bounds() -> None:
    gate = DccGate(Limeric(kind="limeric"), 1)
    assert gate.interval(0, 0.000448) == 0.025
    gate.share[:] = 0.0006
    assert gate.interval(0, 0.000448) == pytest.approx(0.448 / 0.6)
    assert gate.interval(0, 0.001) == 1.0


@pytest.mark.parametrize(
    ("busy", "interval"),
    [(0.0, 0.1), (0.29, 0.1), (0.3, 0.2), (0.39, 0.2), (0.4, 0.4), (0.49, 0.4), (0.5, 0.5), (0.59, 0.5), (0.61, 1.0)],
)
def test_reactive_dcc_interval_by_busy_ratio(busy: float, interval: float) -> None:
    """States of ETSI TS 102 687 V1.2.1, table A.1: below 30 %, 30 to 39 %, 40 to 49 %, 50 to 60 %, above 60 %."""
    gate = DccGate(ReactiveDcc(kind="reactive"), 2)
    gate.update(np.array([busy, 0.0]))
    assert gate.interval(0, 0.001) == interval
    assert gate.interval(1, 0.001) == 0.1


def test_no_dcc_interval_is_zero() -> None:
    assert DccGate(NoDcc(), 1).interval(0, 0.001) == 0.0


def test_reactive_dcc_with_invalid_table_raises() -> None:
    with pytest.raises(ValueError, match="limits must be ascending"):
        ReactiveDcc(kind="reactive", limits=(0.3, 0.2), intervals=(0.1, 0.2))
    with pytest.raises(ValueError, match="limits must be ascending"):
        ReactiveDcc(kind="reactive", limits=(0.3,), intervals=(0.1, 0.2))
