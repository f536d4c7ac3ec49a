from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest

from eidrive_scenario.openscenario.model import Priority, RelativeDistanceType, Rule
from eidrive_scenario.openscenario.model.declarations import Limits
from eidrive_scenario.openscenario.values.scalars import (
    BOOLEAN,
    DATE_TIME,
    DOUBLE,
    INTEGER,
    Scalar,
    enumeration,
    whole_number,
)


@pytest.mark.parametrize(
    ("scalar", "text", "value"),
    [
        (DOUBLE, "1.5", 1.5),
        (DOUBLE, " -1.5e-3\n", -0.0015),
        (DOUBLE, ".5", 0.5),
        (DOUBLE, "5.", 5.0),
        (DOUBLE, "INF", float("inf")),
        (DOUBLE, "-INF", float("-inf")),
        (INTEGER, "+7", 7),
        (INTEGER, "-2147483648", -(2**31)),
        (BOOLEAN, "true", True),
        (BOOLEAN, " 0 ", False),
        (whole_number(Limits(0, 65535)), "65535", 65535),
        (DATE_TIME, "2020-10-01T18:30:30", datetime(2020, 10, 1, 18, 30, 30)),
        (DATE_TIME, "2020-10-01T18:30:30.25Z", datetime(2020, 10, 1, 18, 30, 30, 250000, UTC)),
        (DATE_TIME, "2020-12-31T24:00:00+02:00", datetime(2021, 1, 1, tzinfo=timezone(timedelta(hours=2)))),
    ],
)
def test_scalar_conversion_has_expected_value(scalar: Scalar, text: str, value: Any) -> None:
    assert scalar.convert(text) == value


@pytest.mark.parametrize(
    ("scalar", "text"),
    [
        (DOUBLE, ""),
        (DOUBLE, "nan"),
        (DOUBLE, "+INF"),
        (DOUBLE, "1_000"),
        (DOUBLE, "1,5"),
        (DOUBLE, "\u0661"),
        (INTEGER, "1.0"),
        (INTEGER, "2147483648"),
        (INTEGER, "9" * 5000),
        (BOOLEAN, "True"),
        (BOOLEAN, "yes"),
        (whole_number(Limits(0, 65535)), "-1"),
        (DATE_TIME, "2020-10-01"),
        (DATE_TIME, "2020-02-30T00:00:00"),
        (DATE_TIME, "2020-10-01T24:00:01"),
    ],
)
def test_invalid_scalar_raises_value_error(scalar: Scalar, text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        scalar.convert(text)


def test_enumeration_literals_depend_on_the_version() -> None:
    assert enumeration(Rule, (1, 1)).convert("greaterOrEqual") is Rule.GREATER_OR_EQUAL
    with pytest.raises(ValueError, match=r"since 1\.1; the version of the file is 1\.0"):
        enumeration(Rule, (1, 0)).convert("greaterOrEqual")


def test_deprecated_literals_are_accepted_and_marked() -> None:
    old, new = enumeration(Priority, (1, 1)), enumeration(Priority, (1, 2))
    assert old.convert("overwrite") is new.convert("overwrite") is Priority.OVERWRITE
    assert not old.deprecated
    assert new.deprecated == {Priority.OVERWRITE}
    assert enumeration(RelativeDistanceType, (1, 0)).convert("cartesianDistance")
