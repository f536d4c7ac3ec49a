"""Criterion `monitor`: value at the end, or throughout."""

from __future__ import annotations

from typing import Any

import pytest
from eidrive_criteria.monitor import Monitor, MonitorSettings
from msgspec.structs import replace

from eidrive_scenario.api.criteria import Verdict, evaluate_criteria


def verdict(frame: Any, values: list[bool | None], **settings: Any) -> Verdict:
    """Return the verdict over frames 1 s apart."""
    frames = [
        replace(frame(float(time), {}), monitors={} if value is None else {"Seen": value})
        for time, value in enumerate(values)
    ]
    (found,) = evaluate_criteria(frames, [Monitor(MonitorSettings(of="Seen", **settings))])
    return found


@pytest.mark.parametrize(
    ("values", "settings", "passed", "violation"),
    [
        ([False, False, True], {}, True, None),
        ([False, True, False], {}, False, 2.0),
        ([True, True], {"throughout": True}, True, None),
        ([True, False, True], {"throughout": True}, False, 1.0),
        ([False, False], {"expected": False}, True, None),
        ([None], {}, False, 0.0),
    ],
)
def test_monitor_value_at_the_end_or_throughout(
    frame: Any, values: list[bool | None], settings: dict[str, Any], passed: bool, violation: float | None
) -> None:
    found = verdict(frame, values, **settings)
    assert (found.passed, found.first_violation) == (passed, violation)


@pytest.mark.parametrize("value", [True, False])
def test_monitor_with_the_expected_value_has_the_margin_1(frame: Any, value: bool) -> None:
    criterion = Monitor(MonitorSettings(of="Seen", expected=True))
    evaluate_criteria([replace(frame(0.0, {}), monitors={"Seen": value})], [criterion])
    assert criterion.metrics()["monitor.margin"] == float(value)


def test_monitor_is_fatal_with_throughout_only(frame: Any) -> None:
    assert verdict(frame, [True, False], fatal=True, throughout=True).fatal
    assert not verdict(frame, [False, False], fatal=True).fatal


def test_monitor_reason_states_value_and_time(frame: Any) -> None:
    assert verdict(frame, [False, False, True]).reason == "Seen is true since 2.00 s"
    assert verdict(frame, [None]).reason == "the scenario has no monitor 'Seen'"
