"""Shapes of TransitionDynamics with values by hand: from 10 to 20 over 4."""

from __future__ import annotations

import math
from typing import Any

import pytest
from eidrive_behaviors.actions.lane_change import STANDING

from eidrive_scenario.openscenario.model import DynamicsShape
from eidrive_scenario.storyboard.kinematics.transition_profile import TransitionProfile


@pytest.mark.parametrize(
    ("shape", "quarter", "half"),
    [
        (DynamicsShape.LINEAR, 12.5, 15.0),
        (DynamicsShape.CUBIC, 10.0 + 10.0 * (3 / 16 - 2 / 64), 15.0),
        (DynamicsShape.SINUSOIDAL, 10.0 + 5.0 * (1.0 - math.cos(math.pi / 4)), 15.0),
        (DynamicsShape.STEP, 20.0, 20.0),
    ],
)
def test_transition_values_match_shape(shape: Any, quarter: Any, half: Any) -> None:
    transition = TransitionProfile(shape, 10.0, 20.0, 4.0)
    assert transition.advance(1.0) == pytest.approx(quarter)
    assert transition.advance(1.0) == pytest.approx(half)
    assert transition.advance(2.0) == 20.0
    assert transition.done


@pytest.mark.parametrize(
    ("shape", "extent"),
    [(DynamicsShape.LINEAR, 5.0), (DynamicsShape.CUBIC, 7.5), (DynamicsShape.SINUSOIDAL, 2.5 * math.pi)],
)
def test_rate_is_the_maximum_slope(shape: Any, extent: Any) -> None:
    transition = TransitionProfile.from_rate(shape, 10.0, 20.0, -2.0)
    assert transition.extent == pytest.approx(extent)
    transition.advance(extent / 2 - 1e-4)
    before = transition.value
    assert (transition.advance(2e-4) - before) / 2e-4 == pytest.approx(2.0, rel=1e-4)


def test_rate_of_zero_leaves_a_standing_actor_at_rest() -> None:
    assert TransitionProfile.from_rate(DynamicsShape.LINEAR, 0.0, 60.0, 0.0).advance(3600.0) < STANDING


def test_second_derivative_limit_is_the_maximum() -> None:
    """Cubic: 6 Δ / T² = 0.6 at the ends, so T = 10."""
    assert TransitionProfile.from_second_derivative(DynamicsShape.CUBIC, 0.0, 10.0, 0.6).extent == pytest.approx(10.0)


def test_rate_limit_extends_steep_transitions_except_steps() -> None:
    linear = TransitionProfile(DynamicsShape.LINEAR, 0.0, 20.0, 1.0)
    linear.limit_rate(10.0)
    assert linear.extent == pytest.approx(2.0)
    step = TransitionProfile(DynamicsShape.STEP, 0.0, 20.0, 1.0)
    step.limit_rate(10.0)
    assert step.extent == 0.0


@pytest.mark.parametrize("shape", [DynamicsShape.LINEAR, DynamicsShape.CUBIC, DynamicsShape.SINUSOIDAL])
def test_slope_is_the_derivative_of_the_value(shape: Any) -> None:
    for place in (0.4, 1.0, 2.0, 3.7):
        before, here, after = (TransitionProfile(shape, 10.0, 20.0, 4.0) for _ in range(3))
        numeric = (after.advance(place + 1e-5) - before.advance(place - 1e-5)) / 2e-5
        here.advance(place)
        assert here.slope == pytest.approx(numeric, abs=1e-6)
    assert here.advance(4.0) == 20.0
    assert here.slope == 0.0
