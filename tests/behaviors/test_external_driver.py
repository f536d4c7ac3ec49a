"""Car with poses from outside the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from openscenario_xml import road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import init_xml, private_xml
from street_scene import STREET, at

from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import Pose
from eidrive_scenario.simulation import RunSettings, Simulation

JOYSTICK = """<ObjectController name="seat"><Controller name="joystick" controllerType="movement"><Properties/>
  </Controller></ObjectController>"""
ON = """<ControllerAction><ActivateControllerAction {named} lateral="true" longitudinal="true"/></ControllerAction>"""


@pytest.fixture
def simulation(tmp_path: Path, request: pytest.FixtureRequest) -> Simulation:
    """Return a run of Ego at 20 m/s in lane -1; its controller of another tool is active by default."""
    named = getattr(request, "param", "")
    ego = at(-1, 100.0, 20.0) + (private_xml(ON.format(named=named)) if named is not None else "")
    (tmp_path / "street.xodr").write_text(STREET)
    (tmp_path / "scene.xosc").write_bytes(
        scenario_xml(
            road=road_file_xml("street.xodr"),
            entities=round_car_xml("Ego", JOYSTICK) + round_car_xml("Other"),
            init=init_xml("Ego", ego) + init_xml("Other", at(-2, 50.0, 10.0)),
        )
    )
    settings = RunSettings(dt=0.1, controllers={"joystick": "external"})
    return Simulation(load_scenario(tmp_path / "scene.xosc"), settings=settings)


@pytest.mark.parametrize("simulation", ["", 'objectControllerRef="seat"'], indirect=True)
def test_external_driver_without_poses_stands_still(simulation: Simulation) -> None:
    with simulation:
        views = [simulation.tick()[0].view for _ in range(11)]
    assert [round(float(view.position[view.row("Ego"), 0]), 6) for view in views] == [100.0] * 11
    assert float(views[-1].speed[views[-1].row("Ego")]) == 0.0
    assert views[-1].position[views[-1].row("Other"), 0] == pytest.approx(60.0)


def test_external_pose_applies_in_the_next_view(simulation: Simulation) -> None:
    with simulation:
        simulation.tick()
        simulation.set_pose("Ego", Pose(123.0, -5.5, 0.0, 0.2, 0.0, 0.0), speed=7.0)
        simulation.tick()
        view = simulation.tick()[0].view
        row = view.row("Ego")
        assert view.position[row].tolist() == pytest.approx([123.0, -5.5, 0.0])
        assert float(view.yaw[row]) == pytest.approx(0.2)
        assert float(view.speed[row]) == pytest.approx(7.0)
        where = simulation.storyboard.context.location("Ego")
        assert where is not None
        assert where.lane == -2
        view = simulation.tick()[0].view
    assert view.position[view.row("Ego"), 0] == pytest.approx(123.0)
    assert float(view.speed[view.row("Ego")]) == 0.0


@pytest.mark.parametrize("simulation", [None], indirect=True)
def test_external_driver_while_inactive_keeps_lane_and_speed(simulation: Simulation) -> None:
    with simulation:
        simulation.set_pose("Ego", Pose(500.0, -2.0, 0.0, 0.0, 0.0, 0.0))
        view = [simulation.tick()[0].view for _ in range(11)][-1]
    assert view.position[view.row("Ego"), 0] == pytest.approx(120.0)


def test_external_pose_of_another_entity_is_rejected(simulation: Simulation) -> None:
    with simulation, pytest.raises(SettingError, match="entity 'Other' has no controller model that accepts poses"):
        simulation.set_pose("Other", Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_controller_model_for_unknown_controller_warns(simulation: Simulation) -> None:
    scenario = simulation.scenario
    simulation.close()
    with Simulation(scenario, settings=RunSettings(controllers={"joystik": "external"})) as other:
        (warning,) = map(str, other.storyboard.context.warnings)
    assert "its controller 'joystick' is not executed" in warning
    assert "no controller is named 'joystik'" in warning
