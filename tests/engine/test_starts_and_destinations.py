"""Starts inside of another body or off the road, and missing destinations: errors before the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import agent_xml, catalog_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.base.geometry import Box, overlap
from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import InputError
from eidrive_scenario.simulation import RunSettings, run_file

TRAILER = """<Trailer><TrailerRef entityRef="Cart"/></Trailer></Vehicle>"""
FLAT = """<MiscObject mass="1" name="plate" miscObjectCategory="obstacle"><BoundingBox><Center x="0" y="0" z="0.05"/>
<Dimensions length="1" width="1" height="{height}"/></BoundingBox></MiscObject>"""
BRIDGE = '<WorldPosition x="20" y="-1.75" z="6"/>'
STEP = """<SpeedAction><SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{}"/></SpeedActionTarget></SpeedAction>"""
INSIDE = "'Ego' starts inside of 'Other', whose center is at "


def write(folder: Path, *places: str, driven: bool = True, other: str = "", road: bool = True) -> Path:
    """Write a scenario with Ego and Other at positions, on a straight road of 1 km with the lane -1 at y = -1.75 m."""
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=2), length=1000.0)))
    path = folder / "a.xosc"
    lines = [init_xml(name, "\n" + teleport_xml(place)) for name, place in zip(("Ego", "Other"), places, strict=False)]
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr") if road else "",
            entities=object_xml("Ego", controller=agent_xml() if driven else "") + object_xml("Other", other),
            init="\n".join(lines),
            stop=end_xml(0.1),
        )
    )
    return path


def errors(path: Path, **settings: object) -> list[str]:
    with pytest.raises(InputError) as caught:
        run_file(path, settings=RunSettings(**settings))  # type: ignore[arg-type]
    report = check_scenario(path)
    if not settings:
        assert [str(one) for one in report.errors] == [str(one) for one in caught.value.diagnostics]
    return [str(one) for one in caught.value.diagnostics]


def line_of(path: Path, entity: str) -> int:
    """Return the line of the TeleportAction of an entity, which is after that of its Private element."""
    lines = path.read_text().splitlines()
    return 2 + next(number for number, line in enumerate(lines) if f'entityRef="{entity}"' in line)


def test_driven_vehicle_inside_of_another_one_is_an_error_with_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20), lane_position_xml(-1, 22))
    (error,) = errors(path)
    assert error.startswith(f"{path}:{line_of(path, 'Ego')}: {INSIDE}")
    assert error.endswith("; move one of them")


@pytest.mark.parametrize(
    ("other", "overlaps"),
    [
        (lane_position_xml(-1, 20 + 4.4), True),
        (lane_position_xml(-1, 20 + 4.6), False),
        (lane_position_xml(-2, 20), False),
        (BRIDGE, False),
    ],
)
def test_depth_of_the_overlap(tmp_path: Path, other: str, overlaps: bool) -> None:
    """The bodies are 4.5 m long; the other lane is 3.5 m away, and the bridge 6 m above."""
    path = write(tmp_path, lane_position_xml(-1, 20), other)
    if overlaps:
        assert INSIDE in errors(path)[0]
    else:
        assert run_file(path).simulated_s > 0.0


def test_place_of_a_scripted_vehicle_is_no_error(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20), lane_position_xml(-1, 22), driven=False)
    assert run_file(path).simulated_s > 0.0
    assert INSIDE in errors(path, drive="Ego")[0]
    assert "'Other' starts inside of 'Ego'" in errors(path, drive="Other")[0]
    assert len(errors(path, drive=["Ego", "Other"])) == 1, "each pair once"


def test_vehicle_and_its_trailer_overlap(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20), lane_position_xml(-1, 22))
    text = path.read_text().replace("</Vehicle>", TRAILER, 1).replace('"Other"', '"Cart"')
    path.write_text(text.replace('vehicleCategory="car"', 'vehicleCategory="trailer"').replace("trailer", "car", 1))
    assert run_file(path).simulated_s > 0.0


@pytest.mark.parametrize(("height", "overlaps"), [(0.1, False), (1.0, True)])
def test_vehicle_may_start_on_a_flat_object(tmp_path: Path, height: float, overlaps: bool) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20), lane_position_xml(-1, 21), other=FLAT.format(height=height))
    if overlaps:
        assert INSIDE in errors(path)[0]
    else:
        assert run_file(path).simulated_s > 0.0


def test_driven_vehicle_off_the_road_is_an_error_with_its_line(tmp_path: Path) -> None:
    """The right edge of the road is at y = -7 m; the center of the body is 1.4 m ahead of the reference point."""
    path = write(tmp_path, world_position_xml(50, -107))
    (error,) = errors(path)
    assert error.startswith(f"{path}:{line_of(path, 'Ego')}: 'Ego' starts at (5")
    assert "m, 100 m off the nearest road; give a LanePosition, or a world position on a lane" in error


@pytest.mark.parametrize(("place", "road"), [((50, -8), True), ((50, -107), False)], ids=["verge", "no roads"])
def test_places_beside_the_road_and_without_roads_are_allowed(
    tmp_path: Path, place: tuple[int, int], road: bool
) -> None:
    assert run_file(write(tmp_path, world_position_xml(*place), road=road)).simulated_s > 0.0


def test_all_errors_are_reported_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, world_position_xml(50, -107), world_position_xml(51, -107))
    assert [" off " in one for one in errors(path)] == [False, True]


def test_many_vehicles_at_one_place_are_one_error_each() -> None:
    names = [f"Car{number}" for number in range(5)]
    source = scenario_xml(
        entities="".join(object_xml(name, controller=agent_xml()) for name in names),
        init="".join(init_xml(name, teleport_xml(world_position_xml(0))) for name in names),
        stop=end_xml(0.1),
    )
    with pytest.raises(InputError) as caught:
        run_file(source)
    assert [one.message.split(", whose")[0] for one in caught.value.diagnostics] == [
        f"'Car{number}' starts inside of 'Car{number + 1}'" for number in range(4)
    ]
    assert caught.value.diagnostics[0].message.endswith(" m, and of 3 more")


def test_number_of_overlaps_that_are_compared_is_linear(monkeypatch: pytest.MonkeyPatch) -> None:
    """300 vehicles at one place are 44,850 pairs. Each of 200 diagnostics names one other and counts 20 more."""
    pairs: list[int] = []

    def counted(a: Box, b: Box) -> bool:
        pairs.append(1)
        return overlap(a, b)

    monkeypatch.setattr("eidrive_scenario.simulation.start_checks.overlap", counted)
    monkeypatch.setattr("eidrive_scenario.world.physics.contacts.overlap", counted)
    names = [f"Car{number}" for number in range(300)]
    source = scenario_xml(
        entities="".join(object_xml(name) for name in names),
        init="".join(init_xml(name, teleport_xml(world_position_xml(0))) for name in names),
        stop=end_xml(0.1),
    )
    found = check_scenario(source).warnings
    inside = [one.message for one in found if "starts inside of" in one.message]
    assert len(inside) == 200
    assert inside[0].endswith(" m, and of more than 20 more")
    assert found[-1].message == "further actors that start inside of others are not listed"
    assert len(pairs) <= 200 * 22


def test_placed_selection_has_the_line_of_its_action(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20))
    both = '<EntitySelection name="Both"><Members><EntityRef entityRef="Ego"/><EntityRef entityRef="Other"/></Members>'
    text = path.read_text().replace("</Entities>", f"{both}</EntitySelection></Entities>")
    path.write_text(text.replace('<Private entityRef="Ego">', '<Private entityRef="Both">'))
    (error,) = errors(path)
    assert error.startswith(f"{path}:{line_of(path, 'Both')}: {INSIDE}")


def test_destination_off_the_road_is_a_warning_of_the_check(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20))
    acquire = "<RoutingAction><AcquirePositionAction>\n<Position><WorldPosition x='50' y='-107'/></Position>"
    acquire += "</AcquirePositionAction></RoutingAction></PrivateAction></Private>"
    text = path.read_text().replace("</PrivateAction></Private>", f"</PrivateAction><PrivateAction>{acquire}", 1)
    path.write_text(text)
    found = [str(one) for one in check_scenario(path).warnings if one.rule == "waypoint-off-road"]
    assert len(found) == 1
    assert "the destination is 100.0 m outside the road; move it onto a lane" in found[0]


def test_route_criterion_of_a_scenario_with_a_destination(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20))
    criterion = {"route_completion": {"of": "Ego"}}
    (text, *_) = errors(path, criteria=criterion)
    assert text.startswith("RunSettings.criteria: criterion 'route_completion' evaluates a route")
    acquire = f"<AcquirePositionAction><Position>{lane_position_xml(-1, 90)}</Position></AcquirePositionAction>"
    text = path.read_text().replace(
        "</PrivateAction></Private>",
        f"</PrivateAction><PrivateAction><RoutingAction>{acquire}</RoutingAction></PrivateAction></Private>",
        1,
    )
    path.write_text(text)
    (verdict,) = run_file(path, settings=RunSettings(criteria=criterion)).criteria
    assert verdict.value == pytest.approx(1.4 / 70.0), "the center is 1.4 m ahead of the reference point"


def start_warnings(path: Path) -> list[str]:
    found = [text for text in run_file(path).warnings if " starts " in text]
    assert found == [str(one) for one in check_scenario(path).warnings if " starts " in str(one)]
    return found


def world(x: float, y: float, z: float = 0.0) -> str:
    return f'<WorldPosition x="{x}" y="{y}" z="{z}"/>'


def test_scripted_vehicle_inside_of_another_one_is_a_warning_with_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, lane_position_xml(-1, 20), lane_position_xml(-1, 22), driven=False)
    (warning,) = start_warnings(path)
    assert warning.startswith(f"{path}:{line_of(path, 'Ego')}: {INSIDE}")


@pytest.mark.parametrize(
    "place", [world(20, 40.0), world(20, -1.75, -5.0), world(20, -1.75, 6.0)], ids=["beside", "below", "above"]
)
def test_vehicles_stacked_out_of_the_way_are_no_warning(tmp_path: Path, place: str) -> None:
    assert not start_warnings(write(tmp_path, place, place, driven=False))


@pytest.mark.parametrize(("y", "speed", "warned"), [(15.5, 10.0, True), (15.5, 0.0, False), (60.0, 10.0, False)])
def test_scripted_vehicle_that_moves_beside_the_road_is_a_warning(
    tmp_path: Path, y: float, speed: float, warned: bool
) -> None:
    """The road has lanes of 3.5 m from y = -7 m to 3.5 m."""
    path = write(tmp_path, world(20, y), lane_position_xml(-1, 200), driven=False)
    text = path.read_text()
    action = f"<PrivateAction><LongitudinalAction>{STEP.format(speed)}</LongitudinalAction></PrivateAction>"
    path.write_text(text.replace("</PrivateAction>", "</PrivateAction>" + action, 1))
    found = start_warnings(path)
    assert len(found) == int(warned)
    if warned:
        assert "'Ego' starts at" in found[0]
        assert "12 m off the nearest road" in found[0]


def test_vehicle_on_trajectory_of_catalog_maneuver_may_start_beside_road(tmp_path: Path) -> None:
    vertices = "".join(
        f'<Vertex time="{time}"><Position>{world(20 + 10 * time, 15.5)}</Position></Vertex>' for time in (0, 1)
    )
    trajectory = f'<Trajectory name="t" closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>'
    follow = f"""<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>{trajectory}</TrajectoryRef>
    <TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>
    </RoutingAction></PrivateAction>"""
    maneuver = maneuver_xml(event_xml("follow", follow, trigger_xml(condition_xml(time_xml(0.05)))))
    (tmp_path / "ways.xosc").write_bytes(catalog_xml("ways", maneuver))
    path = write(tmp_path, world(20, 15.5), lane_position_xml(-1, 200), driven=False)
    action = f"<PrivateAction><LongitudinalAction>{STEP.format(10.0)}</LongitudinalAction></PrivateAction>"
    text = path.read_text().replace("</PrivateAction>", "</PrivateAction>" + action, 1)
    text = text.replace(
        "<CatalogLocations>", "<CatalogLocations><ManeuverCatalog><Directory path='.'/></ManeuverCatalog>"
    )
    reference = '<CatalogReference catalogName="ways" entryName="maneuver"/>'
    story = acts_xml(act_xml(group_xml(reference)))
    path.write_text(text.replace("</Init>", f"</Init>{story}"))
    assert not start_warnings(path)
