"""Driven vehicles that never get a speed: an error before the run with a selected planner, else a warning."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import agent_xml, controller_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import (
    SPEED_ACTION,
    act_xml,
    acts_xml,
    end_xml,
    event_xml,
    global_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    private_xml,
    speed_xml,
    story_xml,
    teleport_xml,
)

from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import InputError
from eidrive_scenario.simulation import RunSettings, run_file

STANDS = "stands for the whole run"
REQUEST = SPEED_ACTION.format(shape="step", dimension="time", value=0, speed=10)
HALT = SPEED_ACTION.format(shape="step", dimension="time", value=0, speed=0)
ROUTE = private_xml(
    "<RoutingAction><AcquirePositionAction><Position>"
    f"{lane_position_xml(-1, 90)}</Position></AcquirePositionAction></RoutingAction>"
)
TRAJECTORY = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef>
<Trajectory name="way" closed="false"><Shape><Polyline>
<Vertex time="0"><Position><WorldPosition x="20" y="-2"/></Position></Vertex>
<Vertex time="9"><Position><WorldPosition x="90" y="-2"/></Position></Vertex></Polyline></Shape></Trajectory>
</TrajectoryRef><TimeReference>{}</TimeReference><TrajectoryFollowingMode followingMode="position"/>
</FollowTrajectoryAction></RoutingAction>"""
TIMED = TRAJECTORY.format('<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>')
UNTIMED = TRAJECTORY.format("<None/>")
THROTTLE = """<ControllerAction><OverrideControllerValueAction>
<Throttle active="true" value="0.5"/></OverrideControllerValueAction></ControllerAction>"""
ASSIGNED = controller_xml(name="acc")
OTHER = f"<ControllerAction><AssignControllerAction>{ASSIGNED}</AssignControllerAction></ControllerAction>"


def write(
    folder: Path, *init: str, story: str = "", properties: dict[str, object] | None = None, road: bool = True
) -> Path:
    """Write a scenario with the vehicle Ego on a straight road."""
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=2), length=1000.0)))
    path = folder / "a.xosc"
    controller = "" if properties is None else "\n" + agent_xml(**properties)
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr") if road else "",
            entities=object_xml("Ego", controller=controller),
            init=init_xml(
                "Ego", teleport_xml(lane_position_xml(-1, 20) if road else '<WorldPosition x="0" y="0"/>'), *init
            ),
            story=story,
            stop=end_xml(0.1),
        )
    )
    return path


def events(*actions: str, actors: str = "Ego", triggering: bool = False) -> str:
    listed = "".join(event_xml(f"e{number}", action) for number, action in enumerate(actions))
    return acts_xml(act_xml(group_xml(maneuver_xml(listed), actors, triggering=triggering), "<StartTrigger/>"))


def errors(path: Path, **settings: object) -> list[str]:
    given = RunSettings(**settings)  # type: ignore[arg-type]
    with pytest.raises(InputError) as caught:
        run_file(path, settings=given)
    found = [str(one) for one in caught.value.diagnostics]
    assert sorted(str(one) for one in check_scenario(path, settings=given).errors) == sorted(found)
    return found


def warnings(path: Path, **settings: object) -> list[str]:
    given = RunSettings(**settings)  # type: ignore[arg-type]
    found = [text for text in run_file(path, settings=given).warnings if STANDS in text]
    assert found == [str(one) for one in check_scenario(path, settings=given).warnings if STANDS in str(one)]
    return found


def test_selected_planner_without_a_destination_is_an_error_at_its_property(tmp_path: Path) -> None:
    path = write(tmp_path, properties={"planner": "route"})
    line = next(number for number, text in enumerate(path.read_text().splitlines(), 1) if 'name="planner"' in text)
    assert errors(path) == [
        f"{path}:{line}: planner 'route' of 'Ego' has no destination: Ego {STANDS}; give it a SpeedAction, "
        "target_speed or follow_speed_limit; planner none for a vehicle that is parked"
    ]


def test_default_planner_without_a_destination_is_a_warning_at_its_controller(tmp_path: Path) -> None:
    path = write(tmp_path, properties={})
    line = next(number for number, text in enumerate(path.read_text().splitlines(), 1) if "ObjectController" in text)
    (warning,) = warnings(path)
    assert warning.startswith(f"{path}:{line}: the default planner of 'Ego' has no destination: Ego {STANDS}; ")


def test_options_that_select_a_planner(tmp_path: Path) -> None:
    assert f"{tmp_path / 'a.xosc'}:" in errors(write(tmp_path, properties={}), planner="route")[0]
    stack = tmp_path / "stack.yaml"
    stack.write_text("follow_speed_limit: false\nplanner: route\n")
    path = write(tmp_path)
    assert errors(path, drive={"Ego": stack})[0].startswith(f"{stack}:2: planner 'route' of 'Ego' has no destination")
    assert not warnings(path, drive="Ego"), "by default a stack drives at the speed limit"


def test_speed_limits_need_roads(tmp_path: Path) -> None:
    (warning,) = warnings(write(tmp_path, road=False), drive="Ego")
    assert warning.endswith("; without roads there is no speed limit: give it a SpeedAction or target_speed")


@pytest.mark.parametrize(
    ("properties", "init"),
    [
        ({"target_speed": 10}, ()),
        ({"follow_speed_limit": True}, ()),
        ({"planner": "none"}, ()),
        ({}, (speed_xml(10),)),
        ({}, (speed_xml(10, 5.0),)),
    ],
    ids=["target speed", "speed limit", "parked", "initial speed", "slow start"],
)
def test_speeds_of_settings_and_init(tmp_path: Path, properties: dict[str, object], init: tuple[str, ...]) -> None:
    assert not warnings(write(tmp_path, *init, properties={"planner": "route", **properties}))


@pytest.mark.parametrize(
    ("story", "moves"),
    [
        (events(private_xml(REQUEST)), True),
        (events(private_xml(REQUEST), actors="All"), True),
        (events(private_xml(REQUEST), actors="Other"), False),
        (events(private_xml(REQUEST), actors="", triggering=True), True),
        (events(private_xml(HALT)), False),
        (events(private_xml(THROTTLE)), True),
        (events(private_xml(OTHER)), True),
        (events(private_xml(TIMED)), True),
        (events(private_xml(UNTIMED)), False),
        (events(ROUTE), False),
        (events(teleport_xml(lane_position_xml(-1, 50))), False),
    ],
    ids=[
        *("speed", "selection", "other", "triggering", "halt", "throttle", "controller"),
        *("timed trajectory", "trajectory", "route", "teleport"),
    ],
)
def test_actions_of_events(tmp_path: Path, story: str, moves: bool) -> None:
    path = write(tmp_path, story=story, properties={"planner": "route"})
    more = object_xml("Other") + (
        '<EntitySelection name="All"><Members><EntityRef entityRef="Ego"/></Members></EntitySelection>'
    )
    path.write_text(path.read_text().replace("</Entities>", f"{more}</Entities>"))
    assert [STANDS in str(one) for one in check_scenario(path).errors] == [True] * (not moves)


def test_route_without_a_speed(tmp_path: Path) -> None:
    (error,) = errors(write(tmp_path, ROUTE, properties={"planner": "route"}))
    assert f"planner 'route' of 'Ego' has a route, but no speed: Ego {STANDS}; " in error
    assert not warnings(write(tmp_path, ROUTE, speed_xml(5), properties={"planner": "route"}))


@pytest.mark.parametrize("added", [True, False])
def test_vehicle_that_an_event_adds(tmp_path: Path, added: bool) -> None:
    place = f"<AddEntityAction><Position>{lane_position_xml(-1, 20)}</Position></AddEntityAction>"
    action = global_xml(f'<EntityAction entityRef="Ego">{place}</EntityAction>')
    path = write(tmp_path, story=events(action) if added else "", properties={"planner": "route"})
    text = path.read_text()
    path.write_text(text.replace(text[text.index("<Private ") : text.index("</Private>") + 10], ""))
    assert [STANDS in str(one) for one in check_scenario(path).errors] == [True] * added


def test_inactive_controller_is_not_checked(tmp_path: Path) -> None:
    off = '<ControllerAction><ActivateControllerAction lateral="false" longitudinal="false"/></ControllerAction>'
    assert not warnings(write(tmp_path, private_xml(off), properties={"planner": "route"}))


def test_start_and_destination_are_reported_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, properties={"planner": "route"})
    path.write_text(path.read_text().replace(lane_position_xml(-1, 20), '<WorldPosition x="50" y="-107"/>'))
    assert sorted(STANDS in one for one in errors(path)) == [False, True]


def test_planner_of_a_third_party_may_choose_its_speed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, properties={"planner": "route"})
    monkeypatch.setattr("eidrive_scenario.driving.station_declarations.RoutePlanner", type("Another", (), {}))
    assert not warnings(path)


def test_event_with_a_speed_moves_the_vehicle(tmp_path: Path) -> None:
    path = write(tmp_path, story=story_xml(), properties={"planner": "route"})
    text = path.read_text()
    path.write_text(text.replace(end_xml(0.1), end_xml(6.0)))
    assert not [text for text in run_file(path).warnings if "covered only" in text]
