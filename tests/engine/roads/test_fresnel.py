"""Fresnel integrals, compared with those of scipy and with published values."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from eidrive_scenario.roads.model.curves import LONGEST, fresnel


def test_fresnel_integrals_agree_with_scipy() -> None:
    x = np.linspace(-2.0 * LONGEST, 2.0 * LONGEST, 20_001)
    for mine, expected in zip(fresnel(x), special.fresnel(x), strict=True):
        np.testing.assert_allclose(mine, expected, rtol=0.0, atol=2e-15)


@pytest.mark.parametrize(
    ("x", "sine", "cosine"), [(0.0, 0.0, 0.0), (1.0, 0.4382591, 0.7798934), (1.5, 0.6975050, 0.4452612)]
)
def test_fresnel_integrals_of_table(x: float, sine: float, cosine: float) -> None:
    # Abramowitz and Stegun, table 7.7
    assert fresnel(x) == pytest.approx((sine, cosine), abs=6e-8)


def test_fresnel_integrals_of_numbers_equal_those_of_array() -> None:
    x = np.linspace(-2.0 * LONGEST, 2.0 * LONGEST, 201)
    one_by_one = [fresnel(value) for value in x.tolist()]
    np.testing.assert_array_equal(np.array(one_by_one).T, fresnel(x))
