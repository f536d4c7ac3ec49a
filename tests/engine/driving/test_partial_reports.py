"""Objects kept between messages that list a part of the objects of their sender."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.communication.report_store import PartialReportAssembler
from eidrive_scenario.fusion.prediction import predict


def car(number: int, time: float, velocity: float, variance: tuple[float, ...] = ()) -> Detections:
    box = np.array([[0.0, 0.0, 0.8, 4.5, 1.8, 1.5, 0.0]])
    covariance = np.array([[[0.01, 0.002], [0.002, 0.04]]])
    return Detections(
        time,
        box,
        np.ones(1),
        ("car",),
        np.array([[velocity, 0.0]]),
        covariance,
        (number,),
        velocity_variance=np.array(variance),
    )


@pytest.mark.parametrize(
    ("velocity", "variance", "speed_variance"),
    [(10.0, (), 0.25), (10.0, (4.0,), 4.0), (10.0, (0.01,), 0.25), (np.nan, (), 144.0)],
)
def test_covariance_of_kept_objects_grows_as_that_of_tracks(
    velocity: float, variance: tuple[float, ...], speed_variance: float
) -> None:
    """Prediction over t adds v² t² + 2 t³ to each coordinate, with v = 0.5 m/s, the estimate, or 12 m/s if unknown."""
    assembler = PartialReportAssembler(2.28)
    assembler.update([1], car(1, 0.0, velocity, variance))
    kept = assembler.update([2], car(2, 2.0, velocity, variance))
    before = kept.covariance[1]
    added = 4.0 * speed_variance + 16.0
    assert kept.covariance[0] == pytest.approx(before + added * np.eye(2))
    assert before == pytest.approx(np.array([[0.01, 0.002], [0.002, 0.04]]))
    assert kept.velocity_variance == pytest.approx([variance[0] + 12.0, variance[0]] if variance else [])
    state = np.zeros((4, 4))
    state[:2, :2], state[2:, 2:] = before, speed_variance * np.eye(2)
    _, track = predict(np.zeros((1, 4)), state[None], np.array([2.0]), np.zeros(1), np.zeros(1, dtype=np.bool_))
    assert kept.covariance[0] == pytest.approx(track[0, :2, :2])
