"""Renders pictures to train and test on: `python -m training.render_data --out training/data`.

Random places, traffic, cameras and weather; every world has its own generator, keyed by seed, split and number, so that
the same command gives the same data whatever the number of processes. Training, validation and the held-out set differ
in their splits; no road of the library is among them.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from rich.progress import Progress

from eidrive_scenario.perception.learned.image_network import resized
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.world import World
from eidrive_scenario.world.road_objects import signal_heads
from eidrive_scenario.world.weather import Weather
from training.dataset import encode, write
from training.labels import Label, actor_labels, legible, signal_labels
from training.random_roads import Place, random_place
from training.random_scene import Spots, View, random_looks, random_signals, random_traffic, random_view, random_weather

STORED = (512, 384)
"""Width and height of stored pictures: the input of the networks [px]."""
PER_WORLD = 8
"""Pictures of one place, each with other traffic, camera and weather."""
QUALITY = 82


class Shot(NamedTuple):
    """One picture with its labels."""

    data: bytes
    camera: tuple[float, float, float, float]
    weather: Weather
    labels: list[Label]


def shots(seed: int, split: str, number: int) -> list[Shot]:
    """The pictures of one world."""
    rng = generator(seed, "training data", split, number)
    with tempfile.TemporaryDirectory() as folder:
        place = random_place(rng, Path(folder))
    spots = Spots.of(place.roads)
    with World(place.roads) as world:
        place.build_houses(world)
        return [shot(world, place, spots, rng) for _ in range(PER_WORLD)]


def shot(world: World, place: Place, spots: Spots, rng: np.random.Generator) -> Shot:
    """One picture with new traffic; a camera that would stand in a house is drawn again."""
    for name in list(world.names):
        world.remove(name)
    heads = signal_heads(place.roads)
    view = random_view(rng, spots, heads)
    while _inside(view, place):
        view = random_view(rng, spots, heads)
    cast = random_traffic(rng, spots, view)
    if view.carrier is not None:
        cast.append(view.carrier)
    for spec, placement in cast:
        world.add(spec, placement)
    weather = random_weather(rng)
    world.set_weather(weather)
    states = random_signals(rng, place.roads)
    world.set_display_state(states, random_looks(rng, cast, weather))
    reading = ImageSensor(view.settings).capture(world, view.pose, rng)
    carrier = (view.carrier[0].name,) if view.carrier is not None else ()
    labels = actor_labels(reading, world.view(), {spec.name: spec for spec, _ in cast}, carrier)
    labels += signal_labels(reading, heads, states)
    labels = legible(labels, reading, weather)
    settings = view.settings
    camera = (float(settings.width), float(settings.height), settings.fov, float(view.pose[2, 3]))
    return Shot(encode(resized(reading.rgb, STORED), QUALITY), camera, weather, labels)


def _inside(view: View, place: Place) -> bool:
    x, y, z = view.pose[:3, 3].tolist()
    for house in place.houses:
        reach = 1.0 + np.hypot(house.size[0], house.size[1]) / 2
        if np.hypot(house.center[0] - x, house.center[1] - y) < reach and z < house.center[2] + house.size[2]:
            return True
    return False


def table(taken: list[Shot]) -> dict[str, Any]:
    """The columns of a dataset."""
    labels = [(row, label) for row, entry in enumerate(taken) for label in entry.labels]
    camera = np.array([entry.camera for entry in taken])
    scale = np.array(STORED) / camera[:, :2]
    picture = np.array([row for row, _ in labels], dtype=np.int64)
    box = np.array([label.box for _, label in labels]).reshape(-1, 4)
    return {
        "size": np.tile(np.array(STORED), (len(taken), 1)),
        "scale": scale,
        "camera": camera,
        "weather": np.array([entry.weather.name for entry in taken]),
        "visual_range": np.array([entry.weather.visual_range for entry in taken]),
        "sun_elevation": np.array([entry.weather.sun_elevation for entry in taken]),
        "picture": picture,
        "number": np.array([label.number for _, label in labels], dtype=np.int64),
        "box": (box * np.tile(scale[picture], 2)).astype(np.float32),
        "height": (box[:, 3] - box[:, 1]).astype(np.float32),
        "seen": np.array([label.seen for _, label in labels], dtype=np.int64),
        "whole": np.array([label.whole for _, label in labels], dtype=np.int64),
        "distance": np.array([label.distance for _, label in labels], dtype=np.float32),
        "readable": np.array([label.readable for _, label in labels], dtype=bool),
        "place": np.array([label.place for _, label in labels], dtype=np.float32).reshape(-1, 7),
    }


def _shots(task: tuple[int, str, int]) -> list[Shot]:
    cv2.setNumThreads(1)
    return shots(*task)


def render(seed: int, split: str, worlds: int, first: int, processes: int) -> Iterator[list[Shot]]:
    """The pictures of world after world."""
    tasks = [(seed, split, number) for number in range(first, first + worlds)]
    if processes == 1:
        yield from map(_shots, tasks)
        return
    with get_context("spawn").Pool(processes) as pool:
        yield from pool.imap(_shots, tasks)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("training/data"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--split", choices=("train", "validation", "held_out"), default="train")
    parser.add_argument("--worlds", type=int, default=500, help=f"{PER_WORLD} pictures each")
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    started = time.perf_counter()
    taken: list[Shot] = []
    with Progress() as progress:
        bar = progress.add_task(options.split, total=options.worlds)
        for found in render(options.seed, options.split, options.worlds, options.first, options.processes):
            taken += found
            progress.advance(bar)
    write(options.out / options.split, [entry.data for entry in taken], table(taken))
    size = sum(len(entry.data) for entry in taken) / 2**20
    objects = sum(len(entry.labels) for entry in taken)
    passed = time.perf_counter() - started
    print(f"{len(taken)} pictures, {objects} objects, {size:.1f} MiB in {passed:.0f} s")


if __name__ == "__main__":
    main()
