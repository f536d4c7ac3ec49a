"""Sensors in the pybullet world, against hand calculations."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.sensor import Scene
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount, TruthSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance, Visibility


def spec(name: str, size: tuple[float, float, float] = (4.892, 1.837, 1.49), shape: str = "car") -> ActorSpec:
    return ActorSpec(name, shape, "car", size, (0.0, 0.0, size[2] / 2), wheelbase=2.85, max_steering=0.6)


@pytest.fixture
def world() -> Iterator[World]:
    """An ego at the origin, a fire engine 15 m ahead, a car hidden behind it and one beside that."""
    with World(None, dt=0.05, picture_maker=picture_maker) as created:
        created.add(spec("Ego"), Placement(0, 0))
        created.add(spec("Truck", (8.468, 2.891, 3.827), "firetruck"), Placement(15, 0))
        created.add(spec("Hidden"), Placement(30, 0))
        created.add(spec("Beside"), Placement(30, 12, yaw=1.0))
        yield created


def names(rig: Rig, world: World) -> set[str]:
    truth = rig.read(world, world.view()).truth
    assert truth is not None
    return set(truth.names)


def test_world_implements_scene_protocol(world: World) -> None:
    scene: Scene = world
    assert names(Rig(spec("Ego"), {"truth": TruthSettings()}), scene) == {"Truck", "Beside"}  # type: ignore[arg-type]


def test_truth_visibility_of_hidden_car_grows_as_it_moves_out(world: World) -> None:
    """Across the shadow of the truck: from the mount at (-0.5, 0), its edge at x = 30 m is near y = 3.9 m."""
    rig = Rig(spec("Ego"), {"truth": TruthSettings()})
    visible = {}
    for side in np.arange(0.0, 8.0, 0.5):
        world.step({"Hidden": Placement(30, float(side), teleport=True)}, {})
        truth = rig.read(world, world.view()).truth
        assert truth is not None
        visible[float(side)] = dict(zip(truth.names, truth.visibility.tolist(), strict=True)).get("Hidden", 0.0)
    shares = list(visible.values())
    assert shares == sorted(shares)
    assert visible[0.0] == visible[2.0] == 0.0
    assert visible[7.5] == 1.0
    edge = 1.4455 * 30.5 / (15.5 - 4.234)
    assert min(side for side, share in visible.items() if share > 0) == pytest.approx(edge - 0.9 * 0.9185, abs=0.5)


def test_truth_excludes_car_behind_building(world: World) -> None:
    rig = Rig(spec("Ego"), {"truth": TruthSettings()})
    world.add_building("house", (15, 10, 5), (4, 10, 10))
    assert names(rig, world) == {"Truck"}


def test_lidar_measures_rear_of_truck(world: World) -> None:
    """Bumper, lamps and doors are within 3 cm of the end of the box."""
    settings = LidarSettings(channels=16, points_per_second=16 * 360 * 20, range_noise=0.0)
    cloud = Rig(spec("Ego"), {"lidar": settings}).read(world, world.view()).lidars["lidar"]
    points = cloud.world_points
    ahead = points[(np.abs(points[:, 1]) < 1.4) & (points[:, 2] > 0.1) & (points[:, 0] > 5)]
    assert len(ahead) > 20
    np.testing.assert_allclose(ahead[:, 0], 15 - 4.234, atol=0.03)


def test_camera_depth_and_segmentation_show_truck(world: World) -> None:
    """Straight ahead, the depth is the distance of the truck's rear from the camera."""
    settings = CameraSettings(width=64, height=48, mount=Mount(x=2.5, y=0, z=1.5))
    reading = Rig(spec("Ego"), {"front": settings}).read(world, world.view()).cameras["front"]
    assert reading.rgb.shape == (48, 64, 3)
    assert reading.rgb.dtype == np.uint8
    assert reading.segmentation[24, 32] == world.view().rows["Truck"]
    assert reading.depth[24, 32] == pytest.approx(15 - 4.234 - 2.5, abs=0.5)
    assert math.isclose(reading.intrinsics[0, 0], 32 / math.tan(math.radians(50)))


def test_actor_hidden_from_named_sensor_is_transparent_to_it(world: World) -> None:
    """Without the truck, the line of sight reaches the car behind it, whose rear is at 30 - 2.446 m."""
    lidar = LidarSettings(channels=16, points_per_second=16 * 360 * 20, range_noise=0.0)
    camera = CameraSettings(width=64, height=48, mount=Mount(x=2.5, y=0, z=1.0))
    world.add_building("wall", (60, 0, 5), (4, 200, 10))
    for sensor in ("truth_sensor", "roof", "front"):
        world.set_display_state({}, {"Truck": Appearance(visibility=Visibility(named={sensor: False}))})
        rig = Rig(spec("Ego"), {"truth_sensor": TruthSettings(), "roof": lidar, "front": camera})
        readings = rig.read(world, world.view())
        assert readings.truth is not None
        assert set(readings.truth.names) == ({"Hidden", "Beside"} if sensor == "truth_sensor" else {"Truck", "Beside"})
        cloud = readings.lidars["roof"]
        points = cloud.world_points
        ahead = points[(np.abs(points[:, 1]) < 0.9) & (points[:, 2] > 0.1) & (points[:, 0] > 5)]
        assert ahead[:, 0].min() == pytest.approx(30 - 2.446 if sensor == "roof" else 15 - 4.234, abs=0.1)
        visible = "Hidden" if sensor == "front" else "Truck"
        assert readings.cameras["front"].segmentation[24, 32] == world.view().rows[visible]
    world.set_display_state(
        {}, {"Truck": Appearance(visibility=Visibility(sensors=False, named={"truth_sensor": True}))}
    )
    assert names(Rig(spec("Ego"), {"truth_sensor": TruthSettings()}), world) == {"Truck", "Beside"}
    assert names(Rig(spec("Ego"), {"truth": TruthSettings()}), world) == {"Hidden", "Beside"}


def test_camera_on_mast_excludes_mast(world: World) -> None:
    """The camera is inside the top of the mast, which is not in its image; the truck in front is."""
    mast = ActorSpec("RSU", "rsu", "misc", (0.5, 0.5, 4.0), (0.0, 0.0, 2.0))
    world.add(mast, Placement(5.0, 6.0, yaw=-0.5))
    reading = Rig(mast, {"camera": CameraSettings(width=160, height=120)}).read(world, world.view()).cameras["camera"]
    rows = world.view().rows
    assert rows["Truck"] in reading.segmentation
    assert rows["RSU"] not in reading.segmentation
