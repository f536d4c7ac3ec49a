"""Bodies and places of the training scenes, as one file that the GPU machine reads without the engine."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from eidrive_scenario.sensing.bodies import body_surfaces
from eidrive_scenario.world.surfaces import BOX_FACES, box_corners
from training.random_roads import LANE_KINDS, random_place
from training.random_scene import random_actor

ASSETS = Path("training/data/pillars_assets.npz")
SHAPES = {
    "car": 60, "van": 24, "ambulance": 10, "truck": 24, "firetruck": 12, "bus": 20, "motorbike": 12, "bicycle": 12,
    "pedestrian": 24, "rsu": 4, "box": 4,
}  # fmt: skip
"""Number of bodies of each shape; their sizes are drawn around those of `random_scene`."""
MOTIONS = ("walking", "standing", "running", "reeling")
SEED = 54


def write_assets(path: Path, places: int) -> None:
    """Write meshes of random bodies, and lanes and houses of random places.

    Bodies: `triangles` (K, 3, 3) in the frame of the box center [m], `reflectivity` (K,), `first` (M + 1,), `sizes`
    (M, 3), `reference` (M,) distance of the box center ahead of the reference point, `shapes` and `categories` (M,).
    The last body is a box of edge length 1. Places: `lanes` (N, 6) x, y, heading, width, kind of the lane, place;
    `houses` (H, 7) x, y, length, width, height, heading, place.
    """
    rng = np.random.default_rng(SEED)
    triangles, reflectivity, bodies = [], [], []
    for shape, count in SHAPES.items():
        for number in range(count):
            spec = random_actor(rng, shape, shape)
            surfaces = body_surfaces(spec, MOTIONS[number % len(MOTIONS)] if shape == "pedestrian" else "")
            triangles.append(surfaces.triangles - np.array(spec.offset))
            reflectivity.append(surfaces.reflectivity)
            bodies.append((shape, spec.category, spec.size, spec.offset[0]))
    cube = box_corners(np.array([0.0, 0.0, -0.5, 1.0, 1.0, 1.0, 0.0]))[:, BOX_FACES].reshape(-1, 3, 3)
    triangles.append(cube)
    reflectivity.append(np.full(len(cube), 0.17))
    bodies.append(("unit", "misc", (1.0, 1.0, 1.0), 0.0))
    shapes, categories, sizes, ahead = zip(*bodies, strict=True)
    lanes, houses = [], []
    for number in range(places):
        place = random_place(rng)
        kinds = [LANE_KINDS.index(kind) for kind in place.positions.kinds.tolist()]
        poses = place.positions.poses[:, [0, 1, 3]]
        lanes.append(np.column_stack([poses, place.positions.widths, kinds, np.full(len(kinds), number)]))
        houses += [(*house.center[:2], *house.size, house.yaw, float(number)) for house in place.houses]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        path,
        triangles=np.concatenate(triangles).astype(np.float32),
        reflectivity=np.concatenate(reflectivity).astype(np.float32),
        first=np.cumsum([0, *(len(part) for part in triangles)]),
        sizes=np.array(sizes, dtype=np.float32),
        reference=np.array(ahead, dtype=np.float32),
        shapes=np.array(shapes),
        categories=np.array(categories),
        lanes=np.concatenate(lanes).astype(np.float32),
        houses=np.array(houses, dtype=np.float32).reshape(-1, 7),
    )


def main() -> None:
    """Write the assets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=160)
    parser.add_argument("--out", type=Path, default=ASSETS)
    arguments = parser.parse_args()
    write_assets(arguments.out, arguments.places)


if __name__ == "__main__":
    main()
