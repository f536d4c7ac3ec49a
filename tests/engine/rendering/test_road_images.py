"""Tests of images of roads: decks of bridges, distant coordinates, wet slopes, and low roads."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from opendrive_xml import elevation_xml, lanes_xml, map_xml, road_xml

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.rendering.scene import SceneImage
from eidrive_scenario.rendering.tone_mapping import LUMA
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.weather import Weather

PINHOLE = Pinhole.of_fov(160, 120, math.radians(80))
LANES = lanes_xml(1, 1, 3.5)


def looking(x: float, y: float, z: float, pitch: float = 0.0) -> np.ndarray:
    """Return the pose of a camera that looks along x, directed downwards by `pitch`."""
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = (0.0, -1.0, 0.0), (-math.sin(pitch), 0.0, -math.cos(pitch))
    pose[:3, 2], pose[:3, 3] = (math.cos(pitch), 0.0, -math.sin(pitch)), (x, y, z)
    return pose


def rays(pose: np.ndarray) -> np.ndarray:
    """Return the rays (H, W, 3) through the pixels at depth 1 in world axes."""
    lines, columns = np.mgrid[: PINHOLE.height, : PINHOLE.width] + 0.5
    x, y = (columns - PINHOLE.center_x) / PINHOLE.focal, (lines - PINHOLE.center_y) / PINHOLE.focal
    directions: np.ndarray = np.stack([x, y, np.ones_like(x)], axis=-1) @ pose[:3, :3].T
    return directions


@pytest.fixture
def bridge() -> Iterator[World]:
    """Road along x and another one across it, 5 m above and 7 m wide, between x = 46.5 m and 53.5 m."""
    over = road_xml("2", length=200.0, x=50.0, y=-100.0, hdg=math.pi / 2, lanes=LANES, profiles=elevation_xml(5.0))
    with World(
        RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=LANES), over)), picture_maker=picture_maker
    ) as world:
        yield world


def test_deck_of_bridge_is_visible_from_below(bridge: World) -> None:
    """A ray of depth 1 from a height of 1.5 m that rises by z meets the deck at the depth 3.5 / z."""
    pose = looking(35.0, -1.75, 1.5, pitch=-0.3)
    directions = rays(pose)
    with np.errstate(divide="ignore"):
        depth = 3.5 / directions[..., 2]
    x = 35.0 + directions[..., 0] * depth
    meets = (depth > 0.0) & (np.abs(x - 50.0) < 3.4)
    assert meets.sum() > 1000
    np.testing.assert_allclose(bridge.radiance(pose, PINHOLE).depth[meets], depth[meets], rtol=1e-4)


@pytest.mark.parametrize("images", [1, 3], ids=["first", "cached"])
def test_deck_of_bridge_shades_road_below_and_not_itself(bridge: World, images: int) -> None:
    """The sun in the west at 45 degrees shifts the shadow by the height of the deck, to x = 51.5 m to 57.5 m."""
    bridge.set_weather(Weather(sun_azimuth=270.0, sun_elevation=45.0, cloud_cover=0.0))

    def brightness(x: float, z: float) -> float:
        for _ in range(images):
            light = bridge.radiance(looking(x, -1.75, z, math.pi / 2), PINHOLE).luminance[50:70, 70:90]
        return float((light @ LUMA.astype(np.float32)).mean())

    lit = brightness(40.0, 3.0)
    assert brightness(50.0, 3.0) > 0.8 * lit
    assert brightness(54.5, 3.0) < 0.3 * lit
    assert brightness(60.0, 3.0) > 0.8 * lit
    assert brightness(50.0, 8.0) > 0.8 * lit


@pytest.mark.parametrize(("x", "y"), [(696_320.0, 5_332_992.0), (-8192.0, 4096.0)], ids=["utm", "kilometers"])
def test_street_looks_the_same_at_any_coordinates(x: float, y: float) -> None:
    """The coordinates are multiples of 4096 m, with which the texture of the ground repeats."""
    mark = '<roadMark sOffset="0" type="solid" width="0.12" color="white"/>'
    objects = """<objects>
      <object id="b" type="building" name="b" s="50" t="14" zOffset="0" height="8" length="10" width="10"/>
      <object id="p" type="pole" name="p" s="25" t="6" zOffset="0" height="5" radius="0.15"/></objects>"""
    images = []
    for at in ((0.0, 0.0), (x, y)):
        road = road_xml(length=200.0, x=at[0], y=at[1], lanes=lanes_xml(1, 1, 3.5, more=mark), extra=objects)
        with World(RoadNetwork.parse(map_xml(road)), picture_maker=picture_maker) as world:
            images.append(world.radiance(looking(at[0] + 10.0, at[1] - 1.75, 1.4), PINHOLE))
    first, other = images
    np.testing.assert_array_equal(np.isfinite(other.depth), np.isfinite(first.depth))
    np.testing.assert_allclose(other.depth, first.depth, rtol=1e-4)
    np.testing.assert_allclose(other.luminance, first.luminance, rtol=0.02)


def reflection_below_crate(slope: float) -> np.ndarray:
    """Return the mean light of the wet road before a red crate, of a camera and a crate that stand on the slope."""
    pitch = -math.atan(slope)
    pose = looking(20.0, -1.75, 10.0 + 20.0 * slope, pitch)
    pose[:3, 3] -= 1.4 * pose[:3, 1]
    crate = ActorSpec("Crate", "box", "misc", (2.0, 2.0, 2.0), (0.0, 0.0, 1.0), color=(0.9, 0.05, 0.05))
    road = road_xml(length=200.0, lanes=LANES, profiles=elevation_xml(10.0, slope))
    with World(RoadNetwork.parse(map_xml(road)), picture_maker=picture_maker) as world:
        world.set_weather(Weather(wetness=1.0, cloud_cover=1.0, visual_range=1e9))
        world.add(crate, Placement(32.0, -1.75, 10.0 + 32.0 * slope, 0.0, pitch))
        image = world.radiance(pose, PINHOLE)
    lines, columns = np.nonzero(image.segmentation == 0)
    below = image.luminance[lines.max() + 2 : lines.max() + 10, columns.min() + 2 : columns.max() - 1]
    mean: np.ndarray = below.mean(axis=(0, 1))
    return mean


@pytest.mark.parametrize("slope", [-0.1, -0.05, -0.02, 0.02, 0.05, 0.1])
def test_wet_slope_reflects_as_level_road(slope: float) -> None:
    """A crate before a camera is reflected by the plane on which both stand, whatever its inclination."""
    level = reflection_below_crate(0.0)
    inclined = reflection_below_crate(slope)
    assert level[0] > 4.0 * level[2]
    np.testing.assert_allclose(inclined / inclined.sum(), level / level.sum(), rtol=0.2)


@pytest.mark.parametrize(("z", "mirror"), [(3.0, 0.0), (7.0, 5.0)], ids=["below", "above"])
def test_camera_near_deck_mirrors_in_the_road_below(bridge: World, z: float, mirror: float) -> None:
    """At a height of 3 m the road is 3 m below and the deck only 2 m above."""
    image = bridge.image(looking(50.0, -1.75, z), PINHOLE)
    assert isinstance(image, SceneImage)
    assert image.content.ground.height == mirror


def shadow_pixels(
    height: float, above: float = 1.6, pitch: float = 0.05, distance: float = 12.0, slope: float = 0.0
) -> int:
    """Return the number of pixels in the shadow of a crate at a distance, on a road of this height [m] and slope."""
    road = road_xml(length=200.0, lanes=lanes_xml(1, 1, 20.0), profiles=elevation_xml(height, slope))
    size, tilt = distance / 6.0, -math.atan(slope)
    crate = ActorSpec("Crate", "box", "misc", (size, size, size), (0.0, 0.0, size / 2.0))
    with World(RoadNetwork.parse(map_xml(road)), picture_maker=picture_maker) as world:
        world.set_weather(Weather(sun_azimuth=0.0, sun_elevation=35.0, cloud_cover=0.0))
        pose = looking(20.0, -1.75, height + 20.0 * slope + above, pitch + tilt)
        before = world.radiance(pose, PINHOLE).luminance
        world.add(crate, Placement(20.0 + distance, -1.75, height + (20.0 + distance) * slope, 0.0, tilt))
        image = world.radiance(pose, PINHOLE)
    return int(((image.luminance < 0.5 * before).all(axis=-1) & (image.segmentation < 0)).sum())


@pytest.mark.parametrize("height", [-50.0, -3.0, 300.0])
@pytest.mark.parametrize("view", [(1.6, 0.05, 12.0), (6.0, 0.9, 3.0)], ids=["ahead", "down"])
def test_shadow_at_any_height_is_that_on_level_road(height: float, view: tuple[float, float, float]) -> None:
    assert shadow_pixels(0.0, *view) > 30
    assert shadow_pixels(height, *view) == pytest.approx(shadow_pixels(0.0, *view), rel=0.1)


@pytest.mark.parametrize(("pitch", "slope"), [(0.3, 0.0), (0.05, 0.15)], ids=["down", "uphill"])
def test_distant_shadow_does_not_depend_on_pitch_and_slope(pitch: float, slope: float) -> None:
    level = shadow_pixels(0.0, 4.0, 0.05, 30.0)
    assert level > 30
    assert shadow_pixels(0.0, 4.0, pitch, 30.0, slope) == pytest.approx(level, rel=0.2)
