"""Results of criteria: numbers and truth values of numpy, and numbers beyond the range of a float."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.evaluation import Criterion, CriterionSettings, Verdict
from eidrive_scenario.evaluation.criterion import checked_metrics, checked_verdict


class Given(Criterion):
    """Criterion whose verdict and metric have these values."""

    name = "given"

    def __init__(self, value: Any, passed: Any = True) -> None:
        super().__init__(CriterionSettings())
        self.value, self.is_passed = value, passed

    def observe(self, frame: object) -> None:
        pass

    def verdict(self) -> Verdict:
        return Verdict(self.name, self.is_passed, self.value, self.value, "m", None, "", self.is_passed)

    def metrics(self) -> Mapping[str, Any]:
        return {"given.value": self.value}


@pytest.mark.parametrize(
    ("value", "plain"),
    [(np.float32(1.5), 1.5), (np.int64(3), 3.0), (np.True_, 1.0), (True, 1.0), (Fraction(1, 4), 0.25), (7, 7)],
)
def test_results_are_numbers_of_python(value: Any, plain: float) -> None:
    """A comparison of numpy numbers, as in `conclude(distance >= limit, …)`, is no bool; JSON requires one."""
    verdict = checked_verdict(Given(value, np.float64(2.0) >= 1.0))
    assert (verdict.passed, verdict.fatal) == (True, True)
    assert (verdict.value, verdict.limit) == (plain, plain)
    metrics = checked_metrics(Given(value))
    assert json.dumps([verdict.passed, verdict.value, metrics["given.value"]]) == json.dumps([True, plain, plain])


def test_numbers_beyond_a_float_raise() -> None:
    with pytest.raises(InvalidResult, match="returned value = an integer beyond"):
        checked_verdict(Given(10**400))
    with pytest.raises(InvalidResult, match=r"returned 'given\.value': an integer beyond"):
        checked_metrics(Given(10**400))


def test_verdicts_have_the_names_of_their_criteria() -> None:
    """Also if the class returns a constant name: columns of results distinguish verdicts by it."""

    class Constant(Given):
        def verdict(self) -> Verdict:
            return Verdict("constant", True, 1.0, None, "", None, "")

    criterion = Constant(1.0)
    criterion.name = "given_2"
    assert checked_verdict(criterion).name == "given_2"
