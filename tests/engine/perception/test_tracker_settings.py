"""Settings of the tracker: invalid values are errors with the name of the setting."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from eidrive_scenario.perception.tracking.method import TrackerSettings


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"kind": "ukf"}, "'none', 'cv' or 'ctrv'"),
        ({"confirm": [3, 2]}, r"n exceeds m \(got \[3, 2\]"),
        ({"confirm": [0, 2]}, "greater than 0"),
        ({"gate": 1.0}, "less than 1"),
        ({"coast": -1}, "greater than or equal to 0"),
        ({"detection_probability": 1.0}, "less than 1"),
        ({"birth_density": 0.0}, "greater than 0"),
        ({"delete_existence": 0.6}, r"delete_existence exceeds confirm_existence \(got 0.6 and 0.5\)"),
    ],
)
def test_invalid_tracker_settings_are_errors(settings: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValidationError, match=expected):
        TrackerSettings.model_validate(settings)
