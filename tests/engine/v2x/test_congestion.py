"""Congestion control: the table, and LIMERIC's fixed points."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.v2x.radio.congestion import DccGate, Limeric, NoDcc, ReactiveDcc


@pytest.mark.parametrize(("stations", "busy"), [(25, 0.4435), (50, 0.5368), (100, 0.6000), (200, 0.6375)])
def test_limeric_settles_where_its_equation_says(stations: int, busy: float) -> None:
    """share = 0.000816 / (0.016 + 0.0012 K), busy ratio = K share, from either end of the range of shares."""
    control = Limeric(kind="limeric")
    for start in (control.share_min, control.share_max):
        gate = DccGate(control, 1)
        gate.share[:] = start
        for _ in range(600):
            gate.measured(np.minimum(1.0, stations * gate.share))
        assert stations * gate.share[0] == pytest.approx(busy, abs=1e-4)
        assert gate.share[0] == pytest.approx(0.000816 / (0.016 + 0.0012 * stations), rel=1e-3)


def test_stations_begin_where_the_traffic_around_them_has_brought_them() -> None:
    """Alone: 0.0005 / 0.016 is above the largest share. At 60 % busy: 0.0012 · 0.08 / 0.016. At 77 %: the least."""
    limeric = Limeric(kind="limeric")
    shares = [DccGate(limeric, 1, busy).share[0] for busy in (0.0, 0.6, 0.77)]
    assert shares == pytest.approx([0.03, 0.006, 0.0006])
    for busy in (0.0, 0.6, 0.77):
        gate = DccGate(limeric, 1, busy)
        for _ in range(50):
            gate.measured(np.zeros(1))
        assert gate.share[0] == pytest.approx(limeric.steady_share(busy)), "nothing moves while nobody else talks"
    assert DccGate(ReactiveDcc(kind="reactive"), 1, 0.35).interval(0, 0.001) == 0.4


def test_limeric_keeps_intervals_within_their_bounds() -> None:
    gate = DccGate(Limeric(kind="limeric"), 1)
    assert gate.interval(0, 0.000448) == 0.025
    gate.share[:] = 0.0006
    assert gate.interval(0, 0.000448) == pytest.approx(0.448 / 0.6)
    assert gate.interval(0, 0.001) == 1.0


@pytest.mark.parametrize(
    ("busy", "interval"), [(0.0, 0.1), (0.2, 0.1), (0.25, 0.2), (0.35, 0.4), (0.45, 0.5), (0.9, 1.0)]
)
def test_the_reactive_table(busy: float, interval: float) -> None:
    gate = DccGate(ReactiveDcc(kind="reactive"), 2)
    gate.measured(np.array([busy, 0.0]))
    assert gate.interval(0, 0.001) == interval
    assert gate.interval(1, 0.001) == 0.1


def test_without_control_nobody_waits() -> None:
    assert DccGate(NoDcc(), 1).interval(0, 0.001) == 0.0


def test_a_table_must_be_one() -> None:
    with pytest.raises(ValueError, match="limits must rise"):
        ReactiveDcc(kind="reactive", limits=(0.3, 0.2), intervals=(0.1, 0.2))
    with pytest.raises(ValueError, match="limits must rise"):
        ReactiveDcc(kind="reactive", limits=(0.3,), intervals=(0.1, 0.2))
