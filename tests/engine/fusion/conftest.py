"""Fixtures that build reports and fuse them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.v2x.messages.message import StationState

Place = tuple[float, float]


def make_report(
    station: str,
    time: float,
    places: Sequence[Place],
    *,
    yaw: float | Sequence[float] = 0.0,
    velocity: Place | Sequence[Place] = (math.nan, math.nan),
    covariance: object = 0.04,
    kind: str = "car",
    score: float = 0.9,
    size: tuple[float, float, float] = (4.5, 1.8, 1.5),
    tracks: tuple[int, ...] = (),
    complete: bool = True,
    arrived: float | None = None,
    state: StationState | None = None,
    velocity_deviation: float | None = None,
) -> Report:
    """Return a report of objects at these positions; `covariance` is a variance or one or more matrices."""
    count = len(places)
    boxes = np.zeros((count, 7))
    boxes[:, :2] = np.array(places, dtype=float).reshape(count, 2)
    boxes[:, 2], boxes[:, 3:6], boxes[:, 6] = size[2] / 2, size, yaw
    spread = np.asarray(covariance, dtype=float)
    spread = spread * np.eye(2) if spread.ndim == 0 else spread
    detections = Detections(
        time,
        boxes,
        np.full(count, score),
        (kind,) * count,
        np.broadcast_to(np.array(velocity, dtype=float), (count, 2)).copy(),
        np.broadcast_to(spread, (count, 2, 2)).copy(),
        tracks,
        velocity_deviation=velocity_deviation,
    )
    return Report(station, detections, time if arrived is None else arrived, state, complete)


def fuse_reports(
    reports: Sequence[Report], now: float, fusion: CovarianceIntersectionFusion | None = None
) -> Detections:
    """Return the fused objects at `now` after these reports, received in this order."""
    fusion = fusion or CovarianceIntersectionFusion()
    newest: dict[str, Report] = {}
    for report in reports:
        fusion.add_report(report)
        held = newest.get(report.station)
        if held is None or report.detections.time >= held.detections.time:
            newest[report.station] = report
    return fusion.fuse(list(newest.values()), now)


@pytest.fixture(scope="session")
def report() -> Callable[..., Report]:
    return make_report


@pytest.fixture(scope="session")
def fuse() -> Callable[..., Detections]:
    return fuse_reports
