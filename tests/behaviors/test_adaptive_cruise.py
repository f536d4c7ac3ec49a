"""Adaptive cruise control compared with its control law, calculated by hand."""

from __future__ import annotations

import pytest
from opendrive_xml import map_xml, road_xml
from recorded_scene import RunScene
from storyboard_xml import private_xml, speed_xml, teleport_xml
from street_scene import after

from eidrive_scenario.errors import ScenarioError

ON = private_xml('<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>')


def test_cruise_behind_slower_car_settles_at_time_gap_plus_3_m(scene: RunScene) -> None:
    """Behind 10 m/s with 1.5 s: a gap of 3 + 15 m between the bumpers, plus 5 m of both cars."""
    played = scene(60, ("Ego", ON), cruise={}, ego=(-1, 50.0, 20.0), other=(-1, 150.0, 10.0))
    assert played.at(60).speed == pytest.approx(10.0, abs=0.01)
    assert played.at(60, "Other").x - played.at(60).x - 5.0 == pytest.approx(18.0, abs=0.2)


def test_cruise_at_half_the_wanted_gap_brakes_by_the_law(scene: RunScene) -> None:
    """Wanted gap 3 + 1.5 · 10 = 18 m, actual gap 9 m: f = -0.5 and a = 2.5 · -0.5 - 0 - 0 = -1.25 m/s²."""
    played = scene(1, ("Ego", ON), cruise={}, ego=(-1, 100.0, 10.0), other=(-1, 114.0, 10.0))
    assert played.at(0.1).speed == pytest.approx(10.0 - 1.25 * 0.1)


def test_cruise_behind_car_around_a_bend_brakes_by_the_law(scene: RunScene) -> None:
    """Gaps as in the test above, while the road turns by 180° between both cars."""
    geometry = """<geometry s="0" x="0" y="0" hdg="0" length="101"><line/></geometry>
      <geometry s="101" x="101" y="0" hdg="0" length="12.56"><arc curvature="0.25"/></geometry>
      <geometry s="113.56" x="101" y="8" hdg="3.14" length="50"><line/></geometry>"""
    bend = map_xml(road_xml(length=163.56, geometry=geometry))
    played = scene(1, ("Ego", ON), cruise={}, ego=(-1, 100.0, 10.0), other=(-1, 114.0, 10.0), street=bend)
    assert played.at(0.1).speed == pytest.approx(10.0 - 1.25 * 0.1)


def test_cruise_counts_speed_of_oncoming_car_as_negative(scene: RunScene) -> None:
    """Gap 27 m, both fronts are 4 m from the reference points; f = 0.5 and a = 2.5 · 0.5 - 0.5 · (10 + 10) m/s²."""
    turn = teleport_xml('<WorldPosition x="135" y="-2" h="3.141592653589793"/>')
    steps, other = (("Other", turn), ("Ego", ON, after(0.05))), (-1, 135.0, 10.0)
    played = scene(1, *steps, cruise={}, ego=(-1, 99.0, 10.0), other=other)
    assert played.at(0.1, "Other").x - played.at(0.1).x == pytest.approx(35.0)
    assert played.at(0.2).speed == pytest.approx(10.0 + (2.5 * 0.5 - 0.5 * 20.0) * 0.1)


def test_cruise_on_a_free_road_keeps_the_speed_of_speed_actions(scene: RunScene) -> None:
    faster = ("Ego", speed_xml(30), after(2))
    played = scene(6, ("Ego", ON), faster, cruise={}, other=(-2, 150.0, 10.0))
    assert played.at(2.0).speed == pytest.approx(20.0)
    assert played.at(6.0).speed == pytest.approx(30.0)


def test_cruise_in_override_mode_keeps_the_set_speed_property(scene: RunScene) -> None:
    """The acceleration is up to 0.7 of the maximum of 10 m/s²."""
    slower = ("Ego", speed_xml(5), after(2))
    played = scene(4, ("Ego", ON), slower, cruise={"mode": "override", "setSpeed": 25}, other=(-2, 150.0, 10.0))
    assert played.at(0.1).speed == pytest.approx(20.7)
    assert played.at(4.0).speed == pytest.approx(25.0, abs=0.1)


def test_cruise_without_activation_keeps_the_speed(scene: RunScene) -> None:
    played = scene(3, cruise={}, other=(-1, 150.0, 10.0))
    assert played.at(3.0).speed == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("name", "value"), [("timeGap", "soon"), ("timeGap", "-1"), ("lateralDist", "NaN"), ("setSpeed", "fast")]
)
def test_cruise_with_invalid_property_is_rejected_with_its_line(scene: RunScene, name: str, value: str) -> None:
    with pytest.raises(
        ScenarioError,
        match=rf"scene\.xosc:\d+: controller 'cruise': invalid property {name} \(got '{value}'; expected a",
    ):
        scene(1, ("Ego", ON), cruise={"mode": "override", name: value})


def test_cruise_of_vehicle_without_brakes_keeps_the_speed(scene: RunScene) -> None:
    played = scene(2, ("Ego", ON), cruise={}, brakes=0.0, ego=(-1, 50.0, 20.0), other=(-1, 100.0, 19.0))
    assert played.at(2).speed == pytest.approx(20.0)
