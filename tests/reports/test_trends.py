"""Trends of `make reproduce` at a few points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from eidrive_reports import trends as figures
from eidrive_reports.trends import (
    age_by_burst,
    largest_shift,
    precision_by_delay,
    reception_by_distance,
)


def test_largest_shift_of_car_equals_closed_form() -> None:
    assert largest_shift(0.7) == pytest.approx(0.794, abs=5e-4)
    assert largest_shift(0.5) == pytest.approx(1.5)


@pytest.mark.parametrize(("iou", "before", "behind"), [(0.7, 0.05, 0.055), (0.5, 0.095, 0.105)])
def test_precision_by_delay_falls_at_largest_shift(iou: float, before: float, behind: float) -> None:
    """At 15 m/s the largest shifts are reached after 53 and 100 ms."""
    curve = precision_by_delay(15.0, iou, (0.0, before, behind, 0.3))
    assert curve.measured.tolist() == curve.expected.tolist() == [1.0, 1.0, 0.0, 0.0]


def test_precision_by_delay_with_prediction_stays_1() -> None:
    curve = precision_by_delay(15.0, 0.7, (0.1, 0.3), compensated=True)
    assert curve.measured.tolist() == [1.0, 1.0]


@pytest.mark.statistical
def test_reception_by_distance_equals_expected_ratio_with_truck() -> None:
    """Five standard deviations of a proportion of 400 messages are at most 0.125."""
    distances = (300.0, 700.0, 1200.0, 2100.0)
    clear, blocked = (reception_by_distance(distances, truck=truck, messages=400) for truck in (False, True))
    for curve in (clear, blocked):
        assert curve.measured == pytest.approx(curve.expected, abs=0.125)
    assert np.all(clear.measured >= blocked.measured)
    assert clear.measured[1] - blocked.measured[1] > 0.4


@pytest.mark.exhaustive
def test_age_by_burst_grows_in_mean_but_not_in_peak() -> None:
    mean, peak = age_by_burst((1 / 0.7, 2.0, 10.0), messages=40_000)
    assert mean.expected == pytest.approx([0.11286, 0.130, 0.370], abs=5e-4)
    assert peak.expected == pytest.approx(0.16286, abs=5e-5)
    assert mean.measured == pytest.approx(mean.expected, rel=0.08)
    assert peak.measured == pytest.approx(peak.expected, rel=0.04)


@pytest.mark.exhaustive
def test_main_draws_all_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, few in (("DELAYS", (0.005, 0.2)), ("DISTANCES", (500,)), ("BURSTS", (2.0,)), ("SPEEDS", (15.0,))):
        monkeypatch.setattr(figures, name, few)
    figures.main(["--out", str(tmp_path / "trends")])
    assert {path.name for path in (tmp_path / "trends").iterdir()} == {f"{name}.png" for name in figures.FIGURES}
