"""Pictures of scenarios before their run, and of road files."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.errors import SettingError
from eidrive_scenario.evaluation.lines_of_sight import LinesOfSight
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.reporting.drawing.scenario_picture import (
    POINT_HEIGHT,
    ScenarioPicture,
    sector_outline,
    source_figure,
)
from eidrive_scenario.reporting.drawing.vector_canvas import DEFAULT_SIZE, write_figure
from eidrive_scenario.simulation import Simulation

COOP = library_path() / "coop" / "scenario_1.xosc"


@pytest.fixture
def coop() -> Iterator[Simulation]:
    simulation = Simulation(COOP, load_weights=False)
    yield simulation
    simulation.close()


def texts(path: Path) -> set[str]:
    return {element.text or "" for element in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")}


@pytest.mark.parametrize("station", ["Ego", "RSU"])
def test_hidden_points_equal_rays_of_pybullet(coop: Simulation, station: str) -> None:
    """Points at random around a station: rays of pybullet against the bodies give the same answer except at edges."""
    view = coop.world.view()
    row = view.row(station)
    x, y, z = view.position[row].tolist()
    origin = np.array([x, y, z + 3.0])
    generator = np.random.default_rng(1)
    points = np.column_stack([generator.uniform(-40.0, 40.0, (2000, 2)), np.full(2000, POINT_HEIGHT)])
    points += np.array([x, y, z])
    hidden = LinesOfSight(coop.roads).hidden_points(view, row, origin, points)
    hits = coop.world.raycast(np.broadcast_to(origin, points.shape), points, ignore=[station])
    assert 0.05 < hidden.mean() < 0.95
    assert (hidden == (hits.fraction < 1.0)).mean() > 0.99


def test_shadow_of_ego_is_behind_the_firetruck(coop: Simulation) -> None:
    """The crossing car starts out of sight: the firetruck is between both when the car reaches the crossing."""
    picture = ScenarioPicture.of(coop)
    assert picture.station == "Ego"
    ego, truck = (picture.view.centers[picture.view.row(name), :2] for name in ("Ego", "Firetruck"))
    behind = truck + 8.0 * (truck - ego) / math.dist(truck, ego)
    assert any(_contains(polygon, behind) for polygon in picture.shadow)
    assert not any(_contains(polygon, (ego + truck) / 2.0) for polygon in picture.shadow)


def _contains(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Return whether a polygon contains a point, by the even-odd rule."""
    first, second = polygon, np.roll(polygon, -1, axis=0)
    crosses = (first[:, 1] > point[1]) != (second[:, 1] > point[1])
    rise = np.where(crosses, second[:, 1] - first[:, 1], 1.0)
    at = first[:, 0] + (point[1] - first[:, 1]) / rise * (second[:, 0] - first[:, 0])
    return bool((crosses & (at > point[0])).sum() % 2)


def test_picture_has_starts_route_and_trigger_zone(coop: Simulation) -> None:
    """The zone of EgoHasArrived has the tolerance of its condition, at the end of the route of the ego."""
    picture = ScenarioPicture.of(coop, "RSU")
    (zone,) = picture.zones
    assert (zone.name, zone.radius) == ("EgoHasArrived", 4.0)
    (route,) = (path.points for path in picture.paths)
    ego = picture.view.position[picture.view.row("Ego"), :2]
    assert math.dist(route[0], ego) < 1.0
    assert math.dist(route[-1], zone.center) < 0.5
    assert set(picture.sectors) == {"Ego", "RSU"}
    assert picture.station == "RSU"
    section = picture.section(2.0)
    assert section.right >= zone.center[0] + zone.radius
    assert section.right - section.left == pytest.approx(2.0 * (section.top - section.bottom))


def test_unknown_station_is_refused(coop: Simulation) -> None:
    with pytest.raises(SettingError, match="no station 'Bus'"):
        ScenarioPicture.of(coop, "Bus")


def test_figure_names_what_it_shows(tmp_path: Path) -> None:
    write_figure(source_figure(COOP, DEFAULT_SIZE), tmp_path / "a.svg")
    expected = {"Ego", "RSU", "Firetruck", "Incoming", "EgoHasArrived", "road 3", "-1", "2", "s=20"}
    expected |= {"not visible to Ego", "sensor range", "trigger zone", "route", "station", "actor", "conflict area"}
    assert expected <= texts(tmp_path / "a.svg")


SCENARIO = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="" author=""/>
<CatalogLocations/><RoadNetwork/><Entities><ScenarioObject name="Walker"><Pedestrian name="p" mass="80" model="p"
pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.5"
height="1.8"/></BoundingBox><Properties/></Pedestrian></ScenarioObject></Entities><Storyboard><Init><Actions><Private
entityRef="Walker"><PrivateAction><TeleportAction><Position><WorldPosition x="0" y="0"/></Position></TeleportAction>
</PrivateAction></Private></Actions></Init><Story name="s"><Act name="a"><ManeuverGroup name="g"
maximumExecutionCount="1"><Actors selectTriggeringEntities="false"><EntityRef entityRef="Walker"/></Actors>
<Maneuver name="m"><Event name="e"
priority="override"><Action name="walk"><PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory
name="t" closed="false"><Shape><Polyline>VERTICES</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/>
</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>
</PrivateAction></Action><StartTrigger><ConditionGroup><Condition name="near" delay="0" conditionEdge="none">
<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Walker"/></TriggeringEntities>
<EntityCondition><DistanceCondition value="7" freespace="false" rule="lessThan" relativeDistanceType="euclidianDistance"
coordinateSystem="entity"><Position><WorldPosition x="9" y="-3"/></Position></DistanceCondition></EntityCondition>
</ByEntityCondition></Condition></ConditionGroup></StartTrigger></Event></Maneuver></ManeuverGroup></Act></Story>
<StopTrigger/></Storyboard></OpenSCENARIO>"""
VERTICES = "".join(f'<Vertex><Position><WorldPosition x="{x}" y="0"/></Position></Vertex>' for x in (0, 30))


def test_picture_has_trajectory_and_zone_of_distance(tmp_path: Path) -> None:
    (tmp_path / "walk.xosc").write_text(SCENARIO.replace("VERTICES", VERTICES))
    with Simulation(tmp_path / "walk.xosc", load_weights=False) as simulation:
        picture = ScenarioPicture.of(simulation)
    (path,), (zone,) = picture.paths, picture.zones
    assert path.kind == "trajectory"
    np.testing.assert_allclose(path.points, [(0.0, 0.0), (30.0, 0.0)], atol=1e-9)
    assert (zone.name, zone.center, zone.radius) == ("near", (9.0, -3.0), 7.0)
    assert (picture.station, picture.shadow) == ("", ())


def test_scenario_without_roads_and_actors_is_drawn(tmp_path: Path) -> None:
    empty = tmp_path / "empty.xosc"
    empty.write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="" author=""/>'
        "<CatalogLocations/><RoadNetwork/><Entities/><Storyboard><Init><Actions/></Init><StopTrigger/></Storyboard>"
        "</OpenSCENARIO>"
    )
    write_figure(source_figure(empty, DEFAULT_SIZE), tmp_path / "a.svg")
    assert texts(tmp_path / "a.svg") == {"10 m", "x", "y"}


def test_road_file_has_ids_and_marks(tmp_path: Path) -> None:
    write_figure(source_figure(library_path() / "roads" / "two_lane_road.xodr", (85.0, 60.0)), tmp_path / "a.svg")
    written = texts(tmp_path / "a.svg")
    assert {"road 1", "s=100", "reference line with s [m]"} <= written
    assert any(text.startswith("lanes ") for text in written), "the lanes are too narrow for their ids"


@pytest.mark.parametrize("half_angle", [math.pi, 0.5])
def test_sector_outline_ends_at_its_range(half_angle: float) -> None:
    outline = sector_outline(ViewSector(10.0, 5.0, 1.0, 0.3, half_angle, 50.0))
    distances = np.hypot(*(outline - np.array([10.0, 5.0])).T)
    assert distances.max() == pytest.approx(50.0)
    assert (distances.min() == 0.0) == (half_angle < math.pi)
