"""Oracle: exact objects in the line of sight of its truth sensor."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.perception.oracle import OracleDetector
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading

EGO = EgoState(1.5, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_oracle_returns_exact_boxes_classes_and_velocities() -> None:
    boxes = np.arange(14.0).reshape(2, 7)
    truth = TruthReading(
        ("A", "B"), ("car", "pedestrian"), boxes, np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([1, 0.3])
    )
    found = OracleDetector().detect(Readings(1.5, EGO, truth))
    assert found.time == 1.5
    np.testing.assert_array_equal(found.boxes, boxes)
    np.testing.assert_array_equal(found.scores, [1.0, 1.0])
    assert found.classes == ("car", "pedestrian")
    np.testing.assert_array_equal(found.velocity, truth.velocity)
    np.testing.assert_array_equal(found.covariance, np.zeros((2, 2, 2)))


def test_oracle_without_reading_returns_no_objects() -> None:
    assert len(OracleDetector().detect(Readings(1.5, EGO))) == 0


def test_registry_loads_oracle_by_entry_point() -> None:
    assert registry("detectors").load("oracle") is OracleDetector
    assert OracleDetector.needs == {"truth"}
