"""Tests of traffic light states in the notations of several tools, and of their lamps."""

from __future__ import annotations

import pytest

from eidrive_scenario.roads.model.signal_states import lamps, lit, must_stop

GREEN, RED = (("red", "off"), ("yellow", "off"), ("green", "on")), (("red", "on"), ("yellow", "off"), ("green", "off"))


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ("on;off;off", RED),
        ("off;off;on", GREEN),
        ("GREEN", GREEN),
        ("green solidOn circle, red solidOff circle", GREEN),
        ("go", GREEN),
        ("stop", RED),
        *((state, RED) for state in ("dontWalk", "DONT_WALK", "don't walk", "noGo", "do not go")),
        ("redYellow", (("red", "on"), ("yellow", "on"), ("green", "off"))),
        ("stop_attention", (("red", "on"), ("yellow", "on"), ("green", "off"))),
        ("flashing", (("red", "off"), ("yellow", "flashing"), ("green", "off"))),
        ("flashing;off;off", (("red", "flashing"), ("yellow", "off"), ("green", "off"))),
        ("off", (("red", "off"), ("yellow", "off"), ("green", "off"))),
        ("state 17", (("red", "off"), ("yellow", "off"), ("green", "off"))),
        ("off;on", (("red", "off"), ("green", "on"))),
    ],
)
def test_signal_state_lights_lamps(state: str, expected: tuple[tuple[str, str], ...]) -> None:
    assert lamps(state) == expected


def test_single_lamp_is_on_or_off() -> None:
    assert lamps("on", ("yellow",)) == (("yellow", "on"),)
    assert lamps("off", ("yellow",)) == (("yellow", "off"),)


@pytest.mark.parametrize(
    ("state", "stops"),
    [("red", True), ("yellow", True), ("redYellow", True), ("green", False), ("flashing", False), ("off", False)],
)
def test_red_and_yellow_require_a_stop(state: str, stops: bool) -> None:
    assert must_stop(state) is stops


def test_flashing_lamp_is_lit_half_of_each_second() -> None:
    shown = [lit("flashing", ("red", "yellow", "green"), time)[1] for time in (0.0, 0.4, 0.5, 0.9, 1.0, 1.45)]
    assert shown == [True, True, False, False, True, True]
