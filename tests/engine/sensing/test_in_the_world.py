"""The sensors in pybullet's world: the same answers as worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount, TruthSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance, Visibility


def spec(name: str, size: tuple[float, float, float] = (4.892, 1.837, 1.49), shape: str = "car") -> ActorSpec:
    return ActorSpec(name, shape, "car", size, (0.0, 0.0, size[2] / 2), wheelbase=2.85, max_steering=0.6)


@pytest.fixture
def world() -> Iterator[World]:
    """An ego at the origin, a firetruck 15 m ahead, a car hidden behind it and one beside that."""
    with World(None, dt=0.05) as made:
        made.add(spec("Ego"), Placement(0, 0))
        made.add(spec("Truck", (8.468, 2.891, 3.827), "firetruck"), Placement(15, 0))
        made.add(spec("Hidden"), Placement(30, 0))
        made.add(spec("Beside"), Placement(30, 12, yaw=1.0))
        yield made


def names(rig: Rig, world: World) -> set[str]:
    truth = rig.read(world, world.view()).truth
    assert truth is not None
    return set(truth.names)


def test_the_world_is_a_scene(world: World) -> None:
    scene: Scene = world
    assert names(Rig(spec("Ego"), {"truth": TruthSettings()}), scene) == {"Truck", "Beside"}  # type: ignore[arg-type]


def test_a_hidden_car_comes_into_sight_as_it_moves_out(world: World) -> None:
    """Across the truck's shadow: from the mount at (-0.5, 0), the shadow's edge at x = 30 m lies near y = 3.9 m."""
    rig = Rig(spec("Ego"), {"truth": TruthSettings()})
    seen = {}
    for side in np.arange(0.0, 8.0, 0.5):
        world.step({"Hidden": Placement(30, float(side), teleport=True)}, {})
        truth = rig.read(world, world.view()).truth
        assert truth is not None
        seen[float(side)] = dict(zip(truth.names, truth.visibility.tolist(), strict=True)).get("Hidden", 0.0)
    shares = list(seen.values())
    assert shares == sorted(shares)
    assert seen[0.0] == seen[2.0] == 0.0
    assert seen[7.5] == 1.0
    edge = 1.4455 * 30.5 / (15.5 - 4.234)
    assert min(side for side, share in seen.items() if share > 0) == pytest.approx(edge - 0.9 * 0.9185, abs=0.5)


def test_a_building_hides(world: World) -> None:
    rig = Rig(spec("Ego"), {"truth": TruthSettings()})
    world.add_building("house", (15, 10, 5), (4, 10, 10))
    assert names(rig, world) == {"Truck"}


def test_lidar_sees_the_truck_where_it_stands(world: World) -> None:
    settings = LidarSettings(channels=16, points_per_second=16 * 360 * 20, range_noise=0.0)
    sweep = Rig(spec("Ego"), {"lidar": settings}).read(world, world.view()).lidars["lidar"]
    points = sweep.points @ sweep.pose[:3, :3].T + sweep.pose[:3, 3]
    ahead = points[(np.abs(points[:, 1]) < 1.4) & (points[:, 2] > 0.1) & (points[:, 0] > 5)]
    assert len(ahead) > 20
    np.testing.assert_allclose(ahead[:, 0], 15 - 4.234, atol=0.02)


def test_camera_sees_the_truck_where_it_stands(world: World) -> None:
    """Straight ahead, the distance along the axis is that of the truck's rear from the camera."""
    settings = CameraSettings(width=64, height=48, mount=Mount(x=2.5, y=0, z=1.5))
    picture = Rig(spec("Ego"), {"front": settings}).read(world, world.view()).cameras["front"]
    assert picture.rgb.shape == (48, 64, 3)
    assert picture.rgb.dtype == np.uint8
    assert picture.segmentation[24, 32] == world.view().rows["Truck"]
    assert picture.depth[24, 32] == pytest.approx(15 - 4.234 - 2.5, abs=0.5)
    assert math.isclose(picture.intrinsics[0, 0], 32 / math.tan(math.radians(50)))


def test_an_actor_may_be_hidden_from_some_sensors_by_their_names(world: World) -> None:
    """Without the truck, sight from the mounts reaches the car behind it, whose rear is at 30 - 2.446 m."""
    lidar = LidarSettings(channels=16, points_per_second=16 * 360 * 20, range_noise=0.0)
    camera = CameraSettings(width=64, height=48, mount=Mount(x=2.5, y=0, z=1.0))
    world.add_building("wall", (60, 0, 5), (4, 200, 10))
    for blind in ("eyes", "roof", "front"):
        world.set_display_state({}, {"Truck": Appearance(visibility=Visibility(named={blind: False}))})
        rig = Rig(spec("Ego"), {"eyes": TruthSettings(), "roof": lidar, "front": camera})
        readings = rig.read(world, world.view())
        assert readings.truth is not None
        assert set(readings.truth.names) == ({"Hidden", "Beside"} if blind == "eyes" else {"Truck", "Beside"})
        sweep = readings.lidars["roof"]
        points = sweep.points @ sweep.pose[:3, :3].T + sweep.pose[:3, 3]
        ahead = points[(np.abs(points[:, 1]) < 0.9) & (points[:, 2] > 0.1) & (points[:, 0] > 5)]
        assert ahead[:, 0].min() == pytest.approx(30 - 2.446 if blind == "roof" else 15 - 4.234, abs=0.02)
        seen = "Hidden" if blind == "front" else "Truck"
        assert readings.cameras["front"].segmentation[24, 32] == world.view().rows[seen]
    world.set_display_state({}, {"Truck": Appearance(visibility=Visibility(sensors=False, named={"eyes": True}))})
    assert names(Rig(spec("Ego"), {"eyes": TruthSettings()}), world) == {"Truck", "Beside"}
    assert names(Rig(spec("Ego"), {"truth": TruthSettings()}), world) == {"Hidden", "Beside"}


def test_a_camera_on_a_mast_does_not_see_the_mast(world: World) -> None:
    """It sits inside the mast's top, of which nothing may hang in the picture; the truck before it is there."""
    mast = ActorSpec("RSU", "rsu", "misc", (0.5, 0.5, 4.0), (0.0, 0.0, 2.0))
    world.add(mast, Placement(5.0, 6.0, yaw=-0.5))
    reading = Rig(mast, {"camera": CameraSettings(width=160, height=120)}).read(world, world.view()).cameras["camera"]
    rows = world.view().rows
    assert rows["Truck"] in reading.segmentation
    assert rows["RSU"] not in reading.segmentation
