"""Comparison of images with and without the scenery cache of stationary cameras, bit by bit."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from eidrive_reports.street_view import look_at
from eidrive_reports.weather_sheet import street
from sample_car import CarFactory

from eidrive_scenario.extensions.library import names
from eidrive_scenario.rendering.renderer import Renderer
from eidrive_scenario.rendering.scene import Visuals
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import load_weather

PINHOLE = Pinhole.of_fov(240, 160, math.radians(90))
MAST = look_at((42.5, -7.5, 6.0), (21.0, 2.0, 0.0))
WAITING = look_at((1.9, -0.2, 1.35), (22.0, 0.1, 1.15))


@pytest.fixture
def streets() -> Iterator[tuple[World, World]]:
    """Two worlds with the same crossing."""
    with street() as one, street() as other:
        yield one, other


def pictures(worlds: tuple[World, World], pose: np.ndarray, ignore: tuple[str, ...]) -> tuple[Radiance, Radiance]:
    """Return the images of the first world, with cache, and of the second, without cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Renderer, "MOST_KEPT", 0)
        anew = worlds[1].radiance(pose, PINHOLE, ignore=ignore)
    return worlds[0].radiance(pose, PINHOLE, ignore=ignore), anew


def assert_same(one: Radiance, other: Radiance) -> None:
    assert one.luminance.tobytes() == other.luminance.tobytes()
    assert one.depth.tobytes() == other.depth.tobytes()
    assert one.segmentation.tobytes() == other.segmentation.tobytes()


def kept_scenery(world: World) -> int:
    """Return the number of cameras with cached scenery."""
    assert isinstance(world._pictures, Visuals)
    return len(world._pictures._renderer._kept)


@pytest.mark.exhaustive
@pytest.mark.parametrize("weather", names("weather"))
@pytest.mark.parametrize(("pose", "ignore"), [(MAST, ()), (WAITING, ("Ego",))], ids=["mast", "waiting"])
def test_traffic_is_drawn_into_cached_scenery(
    streets: tuple[World, World], pose: np.ndarray, ignore: tuple[str, ...], weather: str
) -> None:
    """Cars move, turn and leave the image; one brakes with lit lamps; the car of the camera only casts a shadow."""
    before = None
    for tick in range(5):
        for world in streets:
            world.set_weather(load_weather(weather))
            placements = {
                "Oncoming": Placement(47.0 - 9.0 * tick, 3.6, 0.0, math.pi, speed=9.0),
                "Rider": Placement(15.5 - 3.0 * tick, 3.4, 0.0, math.pi),
                "Fire engine": Placement(25.4, 8.0 - 4.0 * tick, 0.0, -math.pi / 2 + 0.2 * tick),
            }
            world.step(placements, {})
        kept, anew = pictures(streets, pose, ignore)
        assert_same(kept, anew)
        assert before is None or kept.luminance.tobytes() != before
        before = kept.luminance.tobytes()
    assert kept_scenery(streets[0]) == 1


def test_cache_keeps_stationary_camera_among_moving_ones(streets: tuple[World, World]) -> None:
    world = streets[0]
    for tick in range(3):
        for number in range(Renderer.MOST_KEPT + 6):
            world.radiance(look_at((0.1 * tick + number, 0.0, 1.5), (80.0, 0.0, 1.0)), Pinhole.of_fov(8, 6, 1.0))
        assert_same(*pictures(streets, MAST, ()))
    assert kept_scenery(world) == 1


def test_cache_is_updated_after_changes_of_scenery(streets: tuple[World, World]) -> None:
    """A new house, another weather and a removed actor, each after images with the same content."""

    def twice() -> Radiance:
        for _ in range(3):
            kept, anew = pictures(streets, MAST, ())
            assert_same(kept, anew)
        return kept

    first = twice()
    for world in streets:
        world.add_building("kiosk", (18.0, -9.0, 1.5), (3.0, 3.0, 3.0))
    built = twice()
    for world in streets:
        world.remove("Leader")
    left = twice()
    for world in streets:
        world.set_weather(load_weather("foggy_morning"))
    foggy = twice()
    looks = [each.luminance.tobytes() for each in (first, built, left, foggy)]
    assert len(set(looks)) == len(looks)


def test_cache_of_empty_scene_draws_new_actor(world: World, car: CarFactory) -> None:
    """The scene is an empty plain under clouds, then a car is added to the cached image of the ground."""
    world.set_weather(load_weather("sunny").model_copy(update={"cloud_cover": 1.0}))
    empty = [world.radiance(WAITING, PINHOLE) for _ in range(3)]
    assert_same(empty[0], empty[2])
    world.add(car("A"), Placement(12.0, 1.0, yaw=0.4))
    seen = world.radiance(WAITING, PINHOLE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Renderer, "MOST_KEPT", 0)
        world._pictures = None
        assert_same(seen, world.radiance(WAITING, PINHOLE))
    assert (seen.segmentation == 0).sum() > 100
