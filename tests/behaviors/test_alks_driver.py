"""Models of UN R157 as controllers of a car on a street."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, road_xml, section_xml, successor_xml
from recorded_scene import RunScene
from storyboard_xml import lane_position_xml, private_xml, speed_xml, teleport_xml
from street_scene import after, street

from eidrive_scenario.errors import ScenarioError

ON = private_xml('<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>')
CHANGE = private_xml("""<LateralAction><LaneChangeAction>
  <LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" value="3"/>
  <LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>""")


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_alks_behind_car_that_brakes_to_standstill_avoids_collision(scene: RunScene, model: str) -> None:
    """The lead brakes from 20 m/s at 6 m/s²; 40 m between the bumpers are 45 m between the reference points."""
    stop = ("Other", speed_xml(0, 6, dimension="rate"), after(1))
    steps = (("Ego", ON), stop)
    played = scene(
        20,
        *steps,
        cruise=dict(model=model),
        controller_model="alks",
        ego=(-1, 100.0, 20.0),
        other=(-1, 145.0, 20.0),
        dt=0.05,
    )
    gaps = [rows["Other"].x - rows["Ego"].x - 5.0 for rows in played.rows]
    assert min(gaps) > 0.5
    assert played.at(20).speed == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_alks_brakes_for_cut_in_but_not_for_adjacent_car(scene: RunScene, model: str) -> None:
    properties = dict(model=model, cruise="false", cutInPerceptionDelayMode="Time")
    scenery: dict[str, Any] = {
        "cruise": properties,
        "controller_model": "alks",
        "ego": (-1, 100.0, 20.0),
        "other": (-2, 140.0, 10.0),
        "dt": 0.05,
    }
    assert scene(3.5, ("Ego", ON), **scenery).at(3.5).speed == pytest.approx(20.0)
    played = scene(3.5, ("Ego", ON), ("Other", CHANGE), **scenery)
    assert played.at(3.5).speed < 18.0


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_alks_motion_is_independent_of_lane_ids(scene: RunScene, model: str) -> None:
    """From 200 m on, lane -1 continues straight as lane -2 beside an opening lane -1, which the lane offset shifts."""
    before = section_xml(right=lane_xml(-1, 4, link=lane_links_xml(after=-2)))
    opened = section_xml(right=lane_xml(-1, 4) + lane_xml(-2, 4, link=lane_links_xml(before=-1)), s=200)
    offsets = "".join(f'<laneOffset s="{s}" a="{a}" b="0" c="0" d="0"/>' for s, a in ((0, 0), (200, 4)))
    scenery: dict[str, Any] = {"cruise": dict(model=model), "controller_model": "alks", "dt": 0.1}
    played, plain = (
        scene(8, ("Ego", ON), other=(lane, 240.0, 0.0), street=road, **scenery)
        for lane, road in ((-2, street(offsets + before + opened)), (-1, street(section_xml(right=lane_xml(-1, 4)))))
    )
    assert [rows["Ego"].x for rows in played.rows] == pytest.approx([rows["Ego"].x for rows in plain.rows])


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_alks_motion_is_independent_of_road_directions(scene: RunScene, model: str) -> None:
    """Road 2 runs from x = 1000 back to 200, so that lane -1 of road 1 continues as its lane 1."""
    one = section_xml(right=lane_xml(-1, 4, link=lane_links_xml(after=1)))
    two = section_xml(left=lane_xml(1, 4, link=lane_links_xml(after=-1)))
    meeting = map_xml(
        road_xml(length=200.0, link=successor_xml("2", "end"), lanes=one),
        road_xml("2", x=1000.0, hdg=math.pi, length=800.0, link=successor_xml("1", "end"), lanes=two),
    )
    scenery: dict[str, Any] = {"cruise": dict(model=model), "controller_model": "alks", "dt": 0.1, "ego": (-1, 150, 20)}
    played, plain = (
        scene(8, ("Ego", ON), other=(-1, 190.0, 10.0), street=road, **scenery)
        for road in (meeting, street(section_xml(right=lane_xml(-1, 4))))
    )
    assert [rows["Ego"].x for rows in played.rows] == pytest.approx([rows["Ego"].x for rows in plain.rows])


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM", "adaptive_cruise"])
@pytest.mark.parametrize("steps", [(), (("Other", CHANGE),)], ids=["lead", "cut-in"])
def test_wrong_way_actor_brakes_as_one_in_its_driving_direction(
    scene: RunScene, model: str, steps: tuple[tuple[str, str], ...]
) -> None:
    """The scene is turned by 180° around Ego in lane -1, so that x becomes 1000 - x, and the lane to the right lane 1.

    Other drives slower in front of Ego, or changes from the lane to the right in front of it.
    """
    courses = []
    for sign, turn in ((1, 0.0), (-1, math.pi)):
        pose = f'<Orientation type="relative" h="{turn}"/>'
        beside = lane_position_xml(1 if sign < 0 else -2, 500.0 + sign * 40.0)
        destination = beside if steps else lane_position_xml(-1, 500.0 + sign * 40.0, inside=pose)
        turned = ("Ego", teleport_xml(lane_position_xml(-1, 500.0, inside=pose))), ("Other", teleport_xml(destination))
        played = scene(
            8,
            *turned,
            ("Ego", ON, after(0.2)),
            *steps,
            cruise=dict(model=model),
            controller_model="adaptive_cruise" if model == "adaptive_cruise" else "alks",
            dt=0.05,
        )
        courses.append([sign * (rows["Ego"].x - 500.0) for rows in played.rows[2:]])
        assert played.at(8).speed < 15.0
    assert courses[1] == pytest.approx(courses[0])


def test_alks_on_a_free_road_returns_to_set_speed_comfortably(scene: RunScene) -> None:
    slower = (
        "Ego",
        private_xml("""<ControllerAction><ActivateControllerAction longitudinal="false"/></ControllerAction>"""),
    )
    steps = (("Ego", ON), (*slower, after(1)), ("Ego", speed_xml(10, 10, dimension="rate"), after(1)))
    played = scene(3, *steps, cruise=dict(model="FSM"), controller_model="alks", other=(1, 900.0, 1.0))
    assert played.at(3).speed == pytest.approx(10.0)
    faster = ("Ego", speed_xml(30, 10, dimension="rate"), after(1))
    played = scene(4, ("Ego", ON), faster, cruise=dict(model="FSM"), controller_model="alks", other=(1, 900.0, 1.0))
    assert played.at(4).speed == pytest.approx(30.0)


def test_alks_with_invalid_property_is_rejected(scene: RunScene) -> None:
    with pytest.raises(ScenarioError, match="did you mean 'ReferenceDriver'"):
        scene(1, cruise=dict(model="ReferenzDriver"), controller_model="alks")
    with pytest.raises(ScenarioError, match=r"invalid property aebTTC \(got 'soon'; expected"):
        scene(1, cruise=dict(aebTTC="soon"), controller_model="alks")
    with pytest.raises(ScenarioError, match=r"invalid property fullStop \(got 'ja'; expected true or false\)"):
        scene(1, cruise=dict(fullStop="ja"), controller_model="alks")


@pytest.mark.parametrize("cruise", ["true", "false"])
@pytest.mark.parametrize("speed", [20.0, 36.0])
@pytest.mark.parametrize("model", ["RSS", "FSM"])
def test_alks_stops_before_standing_car_outside_esmini_range(
    scene: RunScene, model: str, speed: float, cruise: str
) -> None:
    """The safe distances of both models contain the stopping distance at their deceleration (69 m and 194 m by FSM)."""
    played = scene(
        25,
        ("Ego", ON),
        cruise=dict(model=model, cruise=cruise),
        controller_model="alks",
        ego=(-1, 100.0, speed),
        other=(-1, 400.0, 0.0),
        dt=0.1,
    )
    assert played.at(25).x < 400.0 - 5.0
