"""Mean errors of the edges of small image boxes: `python -m training.calibrate` writes them into the shipped weights.

Networks were trained on vehicles at least 8 pixels high, in images of other sizes that were scaled; boxes of distant
vehicles in images of the default camera are up to a pixel too large on each side. A car that is 6 pixels high would
seem to be a quarter nearer than it is.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Bytes
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.perception.learned.detector import LearnedDetector
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, VEHICLES, ImageNetwork
from eidrive_scenario.perception.learned.network_loading import SHIPPED, build_network
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.weather import Weather
from training.labels import Label, actor_labels
from training.random_roads import LanePositions, random_place
from training.random_scene import centered_placement, random_actor, view_of_carrier
from training.render_data import PER_WORLD
from training.weight_files import update_card, update_description

NEAREST, FARTHEST = 20.0, 110.0
"""Distances of the vehicles from the camera [m]."""
MOST_VEHICLES = 5
SHAPES = ("car", "car", "car", "van", "truck", "bus")
APART = 9.0
"""Minimum distance between two vehicles [m]."""
VISIBLE = 0.6
"""Minimum visible share of a vehicle; the silhouette of a small one has pixels that the image lacks."""
HEIGHTS = (0.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 20.0, 24.0, 40.0, 80.0)
"""Limits of the classes of box heights [px]."""
LEAST = 30
"""Minimum number of boxes in such a class."""


class Distant(NamedTuple):
    """Image of distant vehicles with their labels."""

    pixels: Bytes
    labels: list[Label]


def distant_vehicles(camera: CameraSettings, worlds: int) -> Iterator[Distant]:
    """Yield images of a camera on a car in clear weather, of vehicles ahead on and beside the lanes."""
    for number in range(worlds):
        rng = generator(1, "calibration of edges", number)
        place = random_place(rng)
        with place.world() as world:
            world.set_weather(Weather(name="clear"))
            for _ in range(PER_WORLD):
                yield _image(world, place.positions, camera, rng)


def _image(world: World, positions: LanePositions, camera: CameraSettings, rng: np.random.Generator) -> Distant:
    x, y, z, heading = positions.draw(rng)
    carrier = random_actor(rng, "Carrier", "car")
    view = view_of_carrier(world, camera, (carrier, centered_placement(carrier, x, y, z, heading)))
    offset = positions.poses[:, :2] - (x, y)
    distance = np.hypot(*offset.T)
    ahead = offset @ (math.cos(heading), math.sin(heading)) > 0.75 * distance
    rows = np.flatnonzero(ahead & (distance > NEAREST) & (distance < FARTHEST))
    specs = {}
    occupied: list[tuple[float, float]] = []
    for row in rng.choice(rows, MOST_VEHICLES).tolist() if len(rows) else ():
        x, y, z, heading = positions.poses[row].tolist()
        if all(math.hypot(x - a, y - b) >= APART for a, b in occupied):
            occupied.append((x, y))
            spec = random_actor(rng, f"Vehicle{len(occupied)}", str(rng.choice(SHAPES)))
            heading += float(rng.choice([0.0, 0.0, 0.0, math.pi]) + rng.normal(0.0, 0.05))
            world.add(spec, centered_placement(spec, x, y, z, heading))
            specs[spec.name] = spec
    reading = ImageSensor(camera).capture(world, view.pose, rng)
    return Distant(reading.rgb, actor_labels(reading, world.view(), specs, ("Carrier",)))


def edge_errors(network: ImageNetwork, images: list[Distant]) -> Array:
    """Return box heights and the distances of the left, top, right and bottom edges outside those of vehicles (N, 5)
    [px]."""
    rows = []
    for image in images:
        whole = [
            label
            for label in image.labels
            if IMAGE_CLASSES[label.number] in VEHICLES
            and label.visible_pixels >= VISIBLE * max(label.silhouette_pixels, 1)
            and label.box[0] > 2.0
            and label.box[2] < network.input_size[0] - 2.0
        ]
        detections = network.find(image.pixels)
        vehicles = detections.boxes[[name in VEHICLES for name in detections.classes]]
        if not whole or not len(vehicles):
            continue
        true = np.array([label.box for label in whole])
        off = np.abs((true[:, None, :2] + true[:, None, 2:] - vehicles[:, :2] - vehicles[:, 2:]) / 2.0).max(axis=2)
        for row, (nearest, column) in enumerate(zip(off.min(axis=1), off.argmin(axis=1), strict=True)):
            if nearest < 0.5 * max(*(true[row, 2:] - true[row, :2]), 6.0):
                box = vehicles[column]
                rows.append([box[3] - box[1], *((box - true[row]) * (-1.0, -1.0, 1.0, 1.0))])
    return np.array(rows)


def outward_rows(errors: Array) -> list[list[float]]:
    """Return the medians of the errors of each class of box heights with enough boxes, with the median height."""
    rows = []
    for least, most in pairwise(HEIGHTS):
        part = errors[(errors[:, 0] >= least) & (errors[:, 0] < most)]
        if len(part) >= LEAST:
            rows.append(np.median(part, axis=0).round(2).tolist())
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("networks", nargs="*", default=["yolov5", "ssd"])
    parser.add_argument("--worlds", type=int, default=400, help=f"number of places with {PER_WORLD} images each")
    options = parser.parse_args()
    camera = LearnedDetector.default_sensors["camera"]
    assert isinstance(camera, CameraSettings)
    images = list(distant_vehicles(camera, options.worlds))
    for name in options.networks:
        path = SHIPPED / f"{name}.npz"
        update_description(path, outward=[])
        errors = edge_errors(build_network(name, LearnedSettings()), images)
        rows = outward_rows(errors)
        update_description(path, outward=rows)
        update_card(path, outward={"script": "training/calibrate.py", "boxes": len(errors), "rows": rows})
        print(f"{name}: {len(errors)} boxes in {len(images)} images")
        for height, *outward in rows:
            print(f"{height:6.1f} px high: {', '.join(f'{value:+.2f}' for value in outward)} px outwards")


if __name__ == "__main__":
    main()
