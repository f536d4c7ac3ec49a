"""Geographic positions on a road along the central meridian of a UTM zone, with another road above it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import elevation_xml, lanes_xml, map_xml, road_xml
from openscenario_xml import scenario_xml
from storyboard_xml import global_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, model
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.positions.resolution import resolve_position

LATITUDE, METERS_PER_DEGREE = 48.0, 111_190.32
"""Arc of the WGS 84 meridian per degree around 48°N: a (1 - e²) (1 - e² sin² 48°)^(-3/2) π / 180 [m]."""
NORTHING = 5_316_300.0


@pytest.fixture
def globe(context: RuntimeContext) -> RuntimeContext:
    """Road to the north from about (0, 0) at z = 10, below another one at z = 17, in shifted coordinates.

    A third road is 400 m beside them on a hill at z = 60.
    """
    reference = "<geoReference>+proj=utm +zone=32 +datum=WGS84</geoReference>"
    lower, upper, beside = (
        road_xml(number, length=400.0, x=x, hdg=math.pi / 2, profiles=elevation_xml(z), lanes=lanes_xml(0, 1, 8))
        for number, x, z in (("1", 0, 10), ("2", 0, 17), ("3", 400, 60))
    )
    roads = RoadNetwork.parse(
        map_xml(lower, upper, beside, header=f'{reference}<offset x="499996" y="{NORTHING}" z="100" hdg="0"/>')
    )
    return RuntimeContext(context.scenario, roads, dt=0.1, seed=0)


def at(context: Any, **frame: Any) -> tuple[Pose, Any]:
    place = resolve_position(model.Position(geo_position=model.GeoPosition(**frame)), context, "A")
    return place.pose, place.location


@pytest.mark.element("GeoPosition")
def test_geographic_distance_equals_distance_on_the_road(globe: RuntimeContext) -> None:
    """On the central meridian x is the false easting, and the scale factor is 0.9996."""
    first, location = at(globe, latitude_deg=LATITUDE, longitude_deg=9.0)
    assert first.x == pytest.approx(4.0, abs=1e-6)
    assert (location.road, location.lane) == ("2", -1)
    north, _ = at(globe, latitude_deg=LATITUDE + 100.0 / METERS_PER_DEGREE, longitude_deg=9.0)
    assert north.y - first.y == pytest.approx(99.96, abs=2e-3)
    assert north.x == pytest.approx(first.x, abs=1e-6)


def test_missing_and_relative_angles_refer_to_the_lane(globe: RuntimeContext) -> None:
    place = {"latitude_deg": LATITUDE, "longitude_deg": 9.0}
    assert at(globe, **place)[0].h == pytest.approx(math.pi / 2)
    relative = model.Orientation(type=model.ReferenceContext.RELATIVE, h=0.3)
    assert at(globe, **place, orientation=relative)[0].h == pytest.approx(math.pi / 2 + 0.3)
    absolute = model.Orientation(type=model.ReferenceContext.ABSOLUTE, h=0.3)
    assert at(globe, **place, orientation=absolute)[0].h == pytest.approx(0.3)


def test_height_follows_ground_level_or_altitude(globe: RuntimeContext) -> None:
    """Without a selection the top-most road counts; `height` is above the zero of the projection."""
    place = {"latitude_deg": LATITUDE, "longitude_deg": 9.0}
    for given, height, road in (
        ({}, 17.0, "2"),
        ({"vertical_road_selection": -1}, 10.0, "1"),
        ({"altitude": 1.5}, 18.5, "2"),
        ({"altitude": 1.5, "vertical_road_selection": -1}, 11.5, "1"),
        ({"height": 111.0}, 11.0, "1"),
    ):
        pose, location = at(globe, **place, **given)
        assert pose.z == pytest.approx(height)
        assert location.road == road
    for level in (1, -2):
        with pytest.raises(ScenarioError, match=f"road level does not exist; got {level}; expected -1 to 0"):
            at(globe, **place, vertical_road_selection=level)


@pytest.mark.element("GeoPosition")
def test_angles_before_version_1_2_are_radians_or_recognized_degrees(globe: RuntimeContext) -> None:
    expected, _ = at(globe, latitude_deg=LATITUDE, longitude_deg=9.0)
    old, _ = at(globe, latitude=math.radians(LATITUDE), longitude=math.radians(9.0))
    assert old[:3] == pytest.approx(expected[:3], abs=1e-6)
    assert globe.warnings == []
    mistaken, _ = at(globe, latitude=LATITUDE, longitude=9.0)
    assert mistaken[:3] == pytest.approx(expected[:3], abs=1e-6)
    assert "are read as degrees" in str(globe.warnings[0])


def test_invalid_or_missing_latitude_is_rejected(globe: RuntimeContext) -> None:
    with pytest.raises(ScenarioError, match="latitudes within"):
        at(globe, latitude_deg=91.0, longitude_deg=9.0)
    with pytest.raises(ScenarioError, match="latitude or longitude is missing"):
        at(globe, latitude_deg=48.0)


def test_position_far_from_roads_is_resolved(globe: RuntimeContext) -> None:
    pose, location = at(globe, latitude_deg=48.1, longitude_deg=9.0)
    assert location is None
    assert pose.x == pytest.approx(4.0, abs=1e-6)
    assert (pose.z, pose.h) == (0.0, 0.0)


def test_file_of_version_1_1_with_radians_loads() -> None:
    """Version 1.1 requires its own attributes and does not define later ones."""
    frame = '<GeoPosition latitude="0.8" longitude="0.1" height="3"/>'
    add = f"<AddEntityAction><Position>{frame}</Position></AddEntityAction>"
    text = scenario_xml(minor=1, init=global_xml(f'<EntityAction entityRef="A">{add}</EntityAction>'))
    with pytest.raises(ScenarioError, match="entity 'A', which does not exist"):
        load_scenario(text)
    with pytest.raises(ScenarioError, match="latitudeDeg"):
        load_scenario(text.replace(b"latitude=", b"latitudeDeg="))
