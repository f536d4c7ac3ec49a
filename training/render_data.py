"""Rendering of images for training and evaluation: `python -m training.render_data --out training/data`.

Random places, traffic, cameras and weather. Each world has a separate generator, keyed by seed, split and number, so
that the same command gives equal data for any number of processes. Training, validation and held-out set differ in
their splits; no road of the library is among them.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.progress import Progress

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.perception.learned.detector import INPUT_SIZE
from eidrive_scenario.perception.learned.image_network import resized
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.world import World
from eidrive_scenario.world.road_objects import signal_heads
from eidrive_scenario.world.weather import Weather
from training.dataset import LABELS, Dataset, encode, write
from training.labels import Label, actor_labels, mark_readable, signal_labels
from training.random_roads import Place, map_worlds, random_place
from training.random_scene import (
    View,
    random_appearances,
    random_signals,
    random_traffic,
    random_view,
    random_weather,
    replace_actors,
)

PER_WORLD = 8
"""Number of images of one place, each with different traffic, camera and weather."""
QUALITY = 82


class Shot(NamedTuple):
    """Image with its labels."""

    data: bytes
    camera: tuple[float, float, float, float]
    weather: Weather
    labels: list[Label]


def shots(seed: int, split: str, number: int) -> list[Shot]:
    """Return the images of one world."""
    rng = generator(seed, "training data", split, number)
    place = random_place(rng)
    with place.world() as world:
        return [shot(world, place, rng) for _ in range(PER_WORLD)]


def shot(world: World, place: Place, rng: np.random.Generator) -> Shot:
    """Return one image with new traffic; cameras inside a house are drawn again."""
    heads = signal_heads(place.roads)
    view = random_view(rng, place.positions, heads)
    while _inside(view, place):
        view = random_view(rng, place.positions, heads)
    carriers = [] if view.carrier is None else [view.carrier]
    actors = [*random_traffic(rng, place.positions, view), *carriers]
    replace_actors(world, actors)
    weather = random_weather(rng)
    world.set_weather(weather)
    states = random_signals(rng, place.roads)
    world.set_display_state(states, random_appearances(rng, actors, weather))
    reading = ImageSensor(view.settings).capture(world, view.pose, rng)
    specs = {spec.name: spec for spec, _ in actors}
    labels = actor_labels(reading, world.view(), specs, [spec.name for spec, _ in carriers])
    labels = mark_readable([*labels, *signal_labels(reading, heads, states)], reading, weather)
    settings = view.settings
    camera = (float(settings.width), float(settings.height), settings.fov, float(view.pose[2, 3]))
    return Shot(encode(resized(reading.rgb, INPUT_SIZE), QUALITY), camera, weather, labels)


def _inside(view: View, place: Place) -> bool:
    x, y, z = view.pose[:3, 3].tolist()
    for house in place.houses:
        reach = 1.0 + np.hypot(house.size[0], house.size[1]) / 2
        if np.hypot(house.center[0] - x, house.center[1] - y) < reach and z < house.center[2] + house.size[2]:
            return True
    return False


def table(images: list[Shot]) -> dict[str, Any]:
    """Return the columns of a dataset."""
    labels = [(row, label) for row, image in enumerate(images) for label in image.labels]
    camera = np.array([image.camera for image in images])
    scale = np.array(INPUT_SIZE) / camera[:, :2]
    image_row = np.array([row for row, _ in labels], dtype=np.int64)
    box = np.array([label.box for _, label in labels]).reshape(-1, 4)
    return {
        "size": np.tile(np.array(INPUT_SIZE), (len(images), 1)),
        "scale": scale,
        "camera": camera,
        "weather": np.array([image.weather.name for image in images]),
        "visual_range": np.array([image.weather.visual_range for image in images]),
        "sun_elevation": np.array([image.weather.sun_elevation for image in images]),
        "picture": image_row,
        "number": np.array([label.number for _, label in labels], dtype=np.int64),
        "box": (box * np.tile(scale[image_row], 2)).astype(np.float32),
        "height": (box[:, 3] - box[:, 1]).astype(np.float32),
        "seen": np.array([label.visible_pixels for _, label in labels], dtype=np.int64),
        "whole": np.array([label.silhouette_pixels for _, label in labels], dtype=np.int64),
        "distance": np.array([label.distance for _, label in labels], dtype=np.float32),
        "readable": np.array([label.readable for _, label in labels], dtype=bool),
        "place": np.array([label.world_box for _, label in labels], dtype=np.float32).reshape(-1, 7),
    }


def render(folder: Path, seed: int, split: str, worlds: int, processes: int, first: int = 0) -> list[Shot]:
    """Write the images of successive worlds from number `first` on into a folder, and return them."""
    images: list[Shot] = []
    with Progress() as progress:
        bar = progress.add_task(f"rendering {split}", total=worlds)
        for world_shots in map_worlds(shots, seed, split, worlds, processes, first):
            images += world_shots
            progress.advance(bar)
    write(folder, [image.data for image in images], table(images))
    return images


def rendered(data: Path, seed: int, split: str, images: int, processes: int) -> Dataset:
    """Return the images of a split in a folder of all splits, rendered if they are missing."""
    folder = data / split
    if not (folder / LABELS).is_file():
        render(folder, seed, split, -(-images // PER_WORLD), processes)
    return Dataset.load(folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("training/data"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--split", choices=("train", "validation", "held_out"), default="train")
    parser.add_argument("--worlds", type=int, default=500, help=f"number of places with {PER_WORLD} images each")
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    started = time.perf_counter()
    folder = options.out / options.split
    images = render(folder, options.seed, options.split, options.worlds, options.processes, options.first)
    size = sum(len(image.data) for image in images) / 2**20
    objects = sum(len(image.labels) for image in images)
    elapsed = time.perf_counter() - started
    print(f"{len(images)} images, {objects} objects, {size:.1f} MiB in {elapsed:.0f} s")


if __name__ == "__main__":
    main()
