"""Images of traffic lights from approaching cars, in all weathers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Integers
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.road_objects import SignalHead, signal_heads
from training.dataset import shows_enough
from training.labels import Label, head_box, mark_readable, signal_labels
from training.random_roads import Place, map_worlds, random_place
from training.random_scene import (
    random_actor,
    random_appearances,
    random_signals,
    random_traffic,
    random_weather,
    replace_actors,
    rows_before,
    view_of_carrier,
)

PER_WORLD = 6
NEAREST, LEAST_PIXELS = 6.0, 8.0
"""Minimum distance of the camera before a light [m], and minimum height of a usual head in the image [px]."""
USUAL_HEIGHT = 0.94
IN_RANGE = 100.0
CAMERAS = (CameraSettings(width=800, height=600, fov=100.0), CameraSettings(width=800, height=600, fov=60.0))
"""The camera of EI-Drive, and one with a smaller field of view, each in half of the images."""


@dataclass(frozen=True)
class Light:
    """Traffic light within the image.

    state     red, redYellow, yellow, green or off
    box       x1 y1 x2 y2 of its visible part [px]; None if it is not visible
    to_read   whether it is required: at least 8 pixels high, not hidden, from its front, not in dense fog or darkness
    """

    id: str
    state: str
    distance: float
    box: tuple[float, float, float, float] | None
    to_read: bool


@dataclass(frozen=True)
class LightScene:
    """One image, the map, and its traffic lights within the image."""

    reading: CameraReading
    roads: RoadNetwork
    lights: tuple[Light, ...]
    weather: str


def light_scenes(seed: int, split: str, worlds: int, processes: int) -> Iterator[LightScene]:
    """Yield images of successive worlds; equal for any number of processes."""
    for scenes in map_worlds(_scenes, seed, split, worlds, processes):
        yield from scenes


def _scenes(seed: int, split: str, number: int) -> list[LightScene]:
    rng = generator(seed, "training data", split, number)
    while True:
        place = random_place(rng)
        heads = signal_heads(place.roads)
        candidates = [head for head in heads if head.signal.dynamic and len(_before(place, head, CAMERAS[0]))]
        if candidates:
            break
    with place.world() as world:
        return [_scene(world, place, heads, candidates, rng) for _ in range(PER_WORLD)]


def _scene(
    world: World, place: Place, heads: list[SignalHead], candidates: list[SignalHead], rng: np.random.Generator
) -> LightScene:
    camera = CAMERAS[int(rng.integers(len(CAMERAS)))]
    rows = _before(place, candidates[int(rng.integers(len(candidates)))], camera)
    x, y, z, heading = place.positions.poses[int(rng.choice(rows))].tolist()
    spec = random_actor(rng, "Carrier", "car")
    carrier = (spec, Placement(x, y, z, heading + float(rng.normal(0.0, 0.05))))
    view = view_of_carrier(world, camera, carrier)
    actors = [carrier, *random_traffic(rng, place.positions, view)]
    replace_actors(world, actors)
    weather = random_weather(rng)
    world.set_weather(weather)
    states = random_signals(rng, place.roads)
    world.set_display_state(states, random_appearances(rng, actors, weather))
    reading = ImageSensor(camera).capture(world, view.pose, rng, ignore=(spec.name,))
    labels = mark_readable(signal_labels(reading, heads, states), reading, weather)
    return LightScene(reading, place.roads, tuple(_lights(reading, heads, labels, states)), weather.name)


def _before(place: Place, head: SignalHead, camera: CameraSettings) -> Integers:
    """Return the lane positions from which a driver approaches this signal, near enough for this camera."""
    focal = camera.width / 2.0 / math.tan(math.radians(camera.fov) / 2.0)
    farthest = focal * USUAL_HEIGHT / LEAST_PIXELS
    return rows_before(place.positions, head, nearest=NEAREST, farthest=farthest)


def _lights(
    reading: CameraReading, heads: list[SignalHead], labels: list[Label], states: Mapping[str, str]
) -> Iterator[Light]:
    """Yield all traffic lights of the map within the image, including hidden ones and those from behind."""
    by_center = {
        label.world_box[:3]: label for label in labels if IMAGE_CLASSES[label.number].startswith("traffic light")
    }
    height, width = reading.segmentation.shape
    for head in heads:
        if not head.signal.dynamic:
            continue
        center = head_box(head)[1]
        distance = float(np.linalg.norm(center - reading.pose[:3, 3]))
        pixel, _ = pixels(center[None], reading)
        if np.isnan(pixel).any() or distance > IN_RANGE or not ((pixel[0] >= 0) & (pixel[0] < (width, height))).all():
            continue
        label = by_center.get(tuple(center.tolist()))
        box = None if label is None else label.box
        to_read = label is not None and label.readable and _shows_enough(label)
        yield Light(head.signal.id, states[head.signal.id], distance, box, to_read)


def _shows_enough(label: Label) -> bool:
    height = label.box[3] - label.box[1]
    return bool(shows_enough(*np.array([height, label.visible_pixels, label.silhouette_pixels])))
