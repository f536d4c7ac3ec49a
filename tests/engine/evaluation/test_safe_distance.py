"""Minimum distances of RSS: the formulas of arXiv 1708.06374 evaluated by hand with the parameters of CARLA."""

import pytest

from eidrive_scenario.evaluation.safe_distance import SafeDistanceModel


@pytest.mark.parametrize(
    ("model", "rear", "front", "expected"),
    [
        (SafeDistanceModel(), 13.89, 13.89, 13.89 + 1.75 + 17.39**2 / 8 - 13.89**2 / 16),
        (SafeDistanceModel(reaction_time=0.5), 5.83, 0.0, 2.915 + 0.4375 + 7.58**2 / 8),
        (SafeDistanceModel(reaction_time=0.5, max_acceleration=2.0), 10.0, 20.0, 0.0),
    ],
)
def test_same_direction_distance(model: SafeDistanceModel, rear: float, front: float, expected: float) -> None:
    assert model.same_direction(rear, front) == pytest.approx(expected)


def test_worked_distances() -> None:
    """Distances that are rounded to millimeters."""
    assert SafeDistanceModel().same_direction(13.89, 13.89) == pytest.approx(41.383, abs=5e-4)
    assert SafeDistanceModel(reaction_time=0.5).same_direction(5.83, 0.0) == pytest.approx(10.535, abs=5e-4)
    assert SafeDistanceModel().opposite(8.0, 5.83) == pytest.approx(50.253, abs=5e-4)


def test_lateral_distance_depends_on_motion_towards_each_other() -> None:
    model = SafeDistanceModel()
    assert model.lateral(0.0, 0.0) == pytest.approx(0.35)
    assert model.lateral(0.5, 0.0) == pytest.approx(1.13125)
    assert model.lateral(0.0, -0.5) == pytest.approx(1.13125)
    assert model.lateral(-2.0, 2.0) == pytest.approx(0.1), "both drive apart, the margin remains"
