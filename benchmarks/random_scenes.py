"""Seven random road users around a lidar, on a car or a mast: scenes that were not used to choose thresholds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

SIZES: Mapping[str, tuple[float, float, float]] = {
    "car": (4.892, 1.837, 1.49),
    "van": (5.9, 2.0, 2.6),
    "truck": (8.468, 2.891, 3.827),
    "bus": (12.0, 2.6, 3.2),
    "motorbike": (2.2, 0.8, 1.6),
    "pedestrian": (0.5, 0.5, 1.75),
}
KINDS = ("car", "car", "car", "van", "truck", "bus", "motorbike", "pedestrian")
OTHERS, NEAREST, FARTHEST, CLEARANCE = 7, 6.0, 45.0, 1.0


class Scene(NamedTuple):
    """Lidar reading, and the true objects: kinds and boxes (7, 7)."""

    readings: Readings
    kinds: tuple[str, ...]
    boxes: NDArray[np.float64]


def random_scenes(count: int, seed: int) -> Iterator[Scene]:
    """Yield scenes without a map; every second one is measured from a mast of 5 m."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        station = "mast" if number % 2 else "car"
        size = (0.3, 0.3, 5.0) if station == "mast" else SIZES["car"]
        objects = [("station", [0.0, 0.0, size[2] / 2, *size, 0.0])]
        while len(objects) <= OTHERS:
            kind = str(rng.choice(KINDS))
            reach, bearing = rng.uniform(NEAREST, FARTHEST), rng.uniform(-math.pi, math.pi)
            length, width, height = SIZES[kind]
            x, y, yaw = reach * math.cos(bearing), reach * math.sin(bearing), rng.uniform(-math.pi, math.pi)
            if not any(
                overlap([x, y, height / 2, length + CLEARANCE, width + CLEARANCE, height, yaw], box)
                for _, box in objects
            ):
                objects.append((kind, [x, y, height / 2, length, width, height, yaw]))
        with World(None, dt=0.05) as world:
            specs = []
            for row, (kind, box) in enumerate(objects):
                shape = kind if row else "rsu" if station == "mast" else "car"
                wheelbase = 0.0 if shape in ("rsu", "motorbike", "pedestrian") else 0.6 * box[3]
                back, body = wheelbase / 2.0, (box[3], box[4], box[5])
                specs.append(ActorSpec(str(row), shape, kind, body, (back, 0.0, box[2]), wheelbase=wheelbase))
                x, y = box[0] - back * math.cos(box[6]), box[1] - back * math.sin(box[6])
                world.add(specs[-1], Placement(x, y, yaw=box[6]))
            readings = Rig(specs[0], {"lidar": LidarSettings()}, seed=seed).read(world, world.view())
        yield Scene(readings, tuple(kind for kind, _ in objects[1:]), np.array([box for _, box in objects[1:]]))
