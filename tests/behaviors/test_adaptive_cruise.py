"""Adaptive cruise control against its law, worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.errors import ScenarioError

ON = """<PrivateAction><ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/>
  </ControllerAction></PrivateAction>"""
SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
  <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
  <SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
  </PrivateAction>"""
AFTER = '<ByValueCondition><SimulationTimeCondition value="{time}" rule="greaterThan"/></ByValueCondition>'


def test_behind_a_slower_car_the_gap_becomes_3_m_and_the_time_gap(scene: Any) -> None:
    """Behind 10 m/s with 1.5 s: 3 + 15 m between bumper and bumper, and 5 m of the two cars."""
    played = scene(60, ("Ego", ON), cruise="", ego=(-1, 50.0, 20.0), other=(-1, 150.0, 10.0))
    assert played.at(60).speed == pytest.approx(10.0, abs=0.01)
    assert played.at(60, "Other").x - played.at(60).x - 5.0 == pytest.approx(18.0, abs=0.2)


def test_a_gap_that_is_half_of_the_wanted_one_brakes_by_the_law(scene: Any) -> None:
    """Wanted: 3 + 1.5 · 10 = 18 m, there: 9 m, so f = -0.5 and a = 2.5 · -0.5 - 0 - 0 = -1.25 m/s²."""
    played = scene(1, ("Ego", ON), cruise="", ego=(-1, 100.0, 10.0), other=(-1, 114.0, 10.0))
    assert played.at(0.1).speed == pytest.approx(10.0 - 1.25 * 0.1)


def test_a_free_road_is_driven_at_the_set_speed_which_speed_actions_change(scene: Any) -> None:
    faster = ("Ego", SPEED.format(speed=30), AFTER.format(time=2))
    played = scene(6, ("Ego", ON), faster, cruise="", other=(-2, 150.0, 10.0))
    assert played.at(2.0).speed == pytest.approx(20.0)
    assert played.at(6.0).speed == pytest.approx(30.0)


def test_in_the_override_mode_the_set_speed_is_the_property(scene: Any) -> None:
    """Up to 0.7 of the largest acceleration of 10 m/s²."""
    mode = '<Property name="mode" value="override"/><Property name="setSpeed" value="25"/>'
    slower = ("Ego", SPEED.format(speed=5), AFTER.format(time=2))
    played = scene(4, ("Ego", ON), slower, cruise=mode, other=(-2, 150.0, 10.0))
    assert played.at(0.1).speed == pytest.approx(20.7)
    assert played.at(4.0).speed == pytest.approx(25.0, abs=0.1)


def test_without_being_activated_it_leaves_the_speed(scene: Any) -> None:
    played = scene(3, cruise="", other=(-1, 150.0, 10.0))
    assert played.at(3.0).speed == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("name", "value"), [("timeGap", "soon"), ("timeGap", "-1"), ("lateralDist", "NaN"), ("setSpeed", "fast")]
)
def test_a_property_that_is_no_number_is_told_with_its_line(scene: Any, name: str, value: str) -> None:
    mode = f'<Property name="mode" value="override"/><Property name="{name}" value="{value}"/>'
    with pytest.raises(
        ScenarioError,
        match=rf"scene\.xosc:\d+: controller 'cruise': invalid property {name} \(got '{value}'; expected a",
    ):
        scene(1, ("Ego", ON), cruise=mode)


def test_a_vehicle_without_brakes_rolls_on_behind_a_slower_car(scene: Any) -> None:
    played = scene(2, ("Ego", ON), cruise="", brakes=0.0, ego=(-1, 50.0, 20.0), other=(-1, 100.0, 19.0))
    assert played.at(2).speed == pytest.approx(20.0)
