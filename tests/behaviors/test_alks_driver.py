"""The models of UN R157 at the wheel of a car on a street."""

from __future__ import annotations

from typing import Any

import pytest
from street_scene import after, private

from eidrive_scenario.errors import ScenarioError

ON = private('<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>')
CHANGE = private("""<LateralAction><LaneChangeAction>
  <LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" value="3"/>
  <LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>""")
BRAKE = private("""<LongitudinalAction><SpeedAction>
  <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="{rate}"/>
  <SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>""")


def said(**properties: str) -> str:
    return "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties.items())


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_behind_a_car_that_brakes_to_a_stop_none_of_them_hits_it(scene: Any, model: str) -> None:
    """From 20 m/s, 40 m behind, at 6 m/s²; 5 m of the two cars."""
    stop = ("Other", BRAKE.format(rate=6, speed=0), after(1))
    steps = (("Ego", ON), stop)
    played = scene(
        20,
        *steps,
        cruise=said(model=model),
        controller_model="alks",
        ego=(-1, 100.0, 20.0),
        other=(-1, 145.0, 20.0),
        dt=0.05,
    )
    gaps = [rows["Other"].x - rows["Ego"].x - 5.0 for rows in played.rows]
    assert min(gaps) > 0.5
    assert played.at(20).speed == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("model", ["Regulation", "ReferenceDriver", "RSS", "FSM"])
def test_it_brakes_for_a_slower_car_that_cuts_in_and_not_for_one_that_stays_beside(scene: Any, model: str) -> None:
    properties = said(model=model, cruise="false", cutInPerceptionDelayMode="Time")
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


def test_on_a_free_road_it_returns_to_its_set_speed_at_2_m_s2(scene: Any) -> None:
    slower = (
        "Ego",
        private("""<ControllerAction><ActivateControllerAction longitudinal="false"/></ControllerAction>"""),
    )
    steps = (("Ego", ON), (*slower, after(1)), ("Ego", BRAKE.format(rate=10, speed=10), after(1)))
    played = scene(3, *steps, cruise=said(model="FSM"), controller_model="alks", other=(1, 900.0, 1.0))
    assert played.at(3).speed == pytest.approx(10.0)
    faster = ("Ego", BRAKE.format(rate=10, speed=30), after(1))
    played = scene(4, ("Ego", ON), faster, cruise=said(model="FSM"), controller_model="alks", other=(1, 900.0, 1.0))
    assert played.at(4).speed == pytest.approx(30.0)


def test_an_unknown_model_is_an_error_with_the_nearest_name(scene: Any) -> None:
    with pytest.raises(ScenarioError, match="did you mean 'ReferenceDriver'"):
        scene(1, cruise=said(model="ReferenzDriver"), controller_model="alks")
    with pytest.raises(ScenarioError, match=r"invalid property aebTTC \(got 'soon'; expected"):
        scene(1, cruise=said(aebTTC="soon"), controller_model="alks")
