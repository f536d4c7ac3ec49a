"""Tests of driven cars on slopes, rays over hills, and buildings of the map."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_image import camera_image
from opendrive_xml import lanes_xml, map_xml, road_xml, superelevation_xml
from sample_car import CarFactory, Resistances

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement
from eidrive_scenario.world.physics.vehicle_parameters import GRAVITY


def road(elevation: str = "", heading: float = 0.0, bank: float = 0.0, objects: str = "") -> RoadNetwork:
    """Return a road of 400 m with one lane of 8 m."""
    return RoadNetwork.parse(
        map_xml(
            road_xml(
                length=400.0,
                hdg=heading,
                profiles=f"<elevationProfile>{elevation}</elevationProfile>{superelevation_xml(bank)}",
                lanes=lanes_xml(0, 1, 8),
                extra=f"<objects>{objects}</objects>",
            )
        )
    )


def slope(grade: float) -> str:
    return f'<elevation s="0" a="0" b="{grade}" c="0" d="0"/>'


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_driven_car_follows_the_slope(car: CarFactory, heading: float) -> None:
    along = np.array([math.cos(heading), math.sin(heading)])
    aside = np.array([math.sin(heading), -math.cos(heading)])
    with World(road(slope(0.05), heading)) as world:
        x, y = 10 * along + 4 * aside
        world.add(car(), Placement(x, y, yaw=heading, speed=10.0), driven=True)
        for _ in range(60):
            world.step({}, {"Ego": Control(throttle=0.3)})
            view = world.view()
            traveled = view.position[0, :2] @ along
            assert view.position[0, 2] == pytest.approx(0.05 * traveled, abs=1e-6)
        assert view.pitch[0] == pytest.approx(-math.atan(0.05), abs=1e-9)
        assert view.roll[0] == pytest.approx(0.0, abs=1e-9)
        assert view.velocity[0, 2] == pytest.approx(0.05 * math.hypot(*view.velocity[0, :2]), rel=1e-3)
        assert abs(view.position[0, :2] @ aside - 4.0) < 1e-3


def test_gravity_accelerates_on_slope_and_brake_holds(car: CarFactory) -> None:
    free: Resistances = {"drag_area": 0, "rolling_resistance": 0}
    with World(road(slope(0.08))) as world:
        world.add(car("Rolls", **free), Placement(200.0, -2.0), driven=True)
        world.add(car("Held", **free), Placement(200.0, -6.0), driven=True)
        for _ in range(40):
            world.step({}, {"Held": Control(brake=0.3)})
        view = world.view()
    assert view.speed[0] == pytest.approx(-GRAVITY * math.sin(math.atan(0.08)) * 2.0, rel=0.02)
    assert view.speed[1] == pytest.approx(0.0, abs=1e-9)
    assert view.position[1, 0] == pytest.approx(200.0, abs=1e-3)


def test_superelevation_rolls_the_car(car: CarFactory) -> None:
    with World(road(bank=0.06), picture_maker=picture_maker) as world:
        world.add(car(), Placement(50.0, -4.0, yaw=math.pi, speed=5.0), driven=True)
        world.step({}, {})
        view = world.view()
    # Against the direction of the road, the superelevation that raised the left side raises the right side.
    assert view.roll[0] == pytest.approx(-0.06, abs=1e-3)
    assert view.position[0, 2] == pytest.approx(-4.0 * math.tan(0.06), rel=0.02)


def test_crest_blocks_line_of_sight(car: CarFactory) -> None:
    crest = '<elevation s="0" a="0" b="0.1" c="0" d="0"/><elevation s="100" a="10" b="-0.1" c="0" d="0"/>'
    with World(road(crest), picture_maker=picture_maker) as world:
        world.add(car("Behind"), Placement(150.0, -4.0, 5.0))
        assert world.raycast([[50.0, -4.0, 6.5]], [[151.0, -4.0, 6.0]]).rows.tolist() == [-1]
        assert world.raycast([[50.0, -4.0, 16.0]], [[151.0, -4.0, 6.0]]).rows.tolist() == [0]
        ground = world.raycast([[60.0, -4.0, 20.0]], [[60.0, -4.0, -5.0]])
        assert ground.position[0, 2] == pytest.approx(6.0, abs=0.05)


def test_building_of_the_map_blocks_rays() -> None:
    place = 's="50" t="20" zOffset="0" hdg="0"'
    house = f'<object id="7" type="building" name="School" {place} length="20" width="10" height="9"/>'
    with World(road(objects=house), picture_maker=picture_maker) as world:
        hits = world.raycast([[50.0, 0.0, 3.0], [50.0, 0.0, 12.0]], [[50.0, 40.0, 3.0], [50.0, 40.0, 12.0]])
    assert hits.rows.tolist() == [-1, -2]
    assert hits.position[0] == pytest.approx((50.0, 15.0, 3.0), abs=1e-3)


def test_image_shows_road_and_verge() -> None:
    pose = np.array([[0.0, 0.0, 1.0, 10.0], [-1.0, 0.0, 0.0, -4.0], [0.0, -1.0, 0.0, 2.0], [0.0, 0.0, 0.0, 1.0]])
    with World(road(), picture_maker=picture_maker) as world:
        picture = camera_image(world, pose, 160, 120, math.radians(90))
    middle, left = picture.rgb[115, 80].astype(int), picture.rgb[70, 2].astype(int)
    assert max(middle) - min(middle) < 15
    assert left[1] > left[0] + 10
    assert left[1] > left[2] + 10
    # Flat ground 2 m below at the center of row 115, 35.5 lines below the axis, with a focal length of 80.
    assert picture.depth[115, 80] == pytest.approx(2.0 * 80 / 55.5, rel=0.01)
