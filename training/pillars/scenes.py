"""Random scenes with stations, as arrays. NumPy is sufficient, so that machines without the engine make scenes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

CLASSES = ("car", "van", "truck", "bus", "motorbike", "bicycle", "pedestrian")
STATIONS = 3
"""Stations of a scene: the receiver, and two senders."""
SLOTS = 64
"""Maximum number of bodies, houses and other objects of a scene."""
LAG = 0.2
"""Time between the two scans of a station [s]."""
PATTERNS = ((32, 312), (32, 156), (64, 500), (16, 450))
"""Rings and columns of the lidars: the default at 10 and at 20 revolutions per second, and others."""
PATTERN_ODDS = (0.5, 0.2, 0.2, 0.1)
FIELDS = (360.0, 180.0, 120.0, 100.0)
"""Fields of view of lidars at the front [degrees]."""
SELDOM_FIELDS = (*(360.0,) * 6, 180.0, 110.0, 100.0)
"""Fields of view of the others [degrees]."""
_SPREAD = 60.0
"""Maximum distance of road users from the receiver [m]."""
_FASTEST = (15.0, 15.0, 50.0)
"""Speed of the fastest motor vehicles in scenes of towns, twice, and of motorways [m/s]."""
_ROWS = 0.3
"""Share of the scenes with a row of equal vehicles: in two scans, a standing row looks like a fast one."""
_ODDS = {
    0: {"car": 0.52, "van": 0.1, "ambulance": 0.03, "truck": 0.1, "firetruck": 0.04, "bus": 0.07, "motorbike": 0.06,
        "bicycle": 0.05, "pedestrian": 0.03},
    1: {"car": 0.62, "van": 0.14, "ambulance": 0.03, "truck": 0.12, "firetruck": 0.04, "bus": 0.05},
    2: {"car": 0.25, "bicycle": 0.3, "motorbike": 0.1, "pedestrian": 0.3, "box": 0.05},
    3: {"pedestrian": 0.75, "bicycle": 0.15, "rsu": 0.05, "box": 0.05},
}  # fmt: skip
"""Shapes of the bodies by kind of the lane."""


@dataclass(frozen=True)
class Assets:
    """Content of the file that `assets` writes."""

    sizes: Array
    shapes: np.ndarray[Any, np.dtype[np.str_]]
    classes: np.ndarray[Any, np.dtype[np.int64]]
    """Row in CLASSES of each body; -1 for others."""
    lanes: tuple[Array, ...]
    houses: tuple[Array, ...]

    @classmethod
    def load(cls, path: Path) -> Assets:
        """Read the file."""
        with np.load(path) as file:
            lanes, houses = file["lanes"], file["houses"]
            places = range(int(lanes[:, 5].max()) + 1)
            return cls(
                file["sizes"],
                file["shapes"],
                np.array([CLASSES.index(name) if name in CLASSES else -1 for name in file["categories"].tolist()]),
                tuple(lanes[lanes[:, 5] == place, :5] for place in places),
                tuple(houses[houses[:, 6] == place, :6] for place in places),
            )


def overlaps(box: Array, boxes: Array) -> bool:
    """Return whether a box (5,) x, y, length, width, heading touches one of boxes (N, 5), by separating axes."""
    if not len(boxes):
        return False
    offset = boxes[:, :2] - box[:2]
    near = np.hypot(*offset.T) < (np.hypot(box[2], box[3]) + np.hypot(boxes[:, 2], boxes[:, 3])) / 2.0
    if not near.any():
        return False
    offset, others = offset[near], boxes[near]
    turn = others[:, 4] - box[4]
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    apart = np.zeros(len(others), dtype=bool)
    first, second = np.broadcast_to(box, others.shape), others
    for heading, own, other in ((box[4], first[:, 2:4], second[:, 2:4]), (others[:, 4], second[:, 2:4], first[:, 2:4])):
        along = np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
        aside = np.cos(heading) * offset[:, 1] - np.sin(heading) * offset[:, 0]
        apart |= np.abs(along) > (own[:, 0] + other[:, 0] * cos + other[:, 1] * sin) / 2.0
        apart |= np.abs(aside) > (own[:, 1] + other[:, 0] * sin + other[:, 1] * cos) / 2.0
    return not bool(apart.all())


class SceneMaker:
    """Maker of scenes. Their coordinates are relative to the receiver at the time of the scan, axes of the world."""

    def __init__(self, assets: Assets) -> None:
        self._assets = assets
        self._shapes = {shape: np.flatnonzero(assets.shapes == shape) for shape in set(assets.shapes.tolist())}

    def scene(self, rng: np.random.Generator) -> dict[str, Array]:
        """Return a scene.

        bodies    (SLOTS, 9) mesh, x, y, z of the center, cos and sin of the heading, scale;  count  of them
        velocity  (SLOTS, 2) [m/s];  boxes (SLOTS, 7);  classes (SLOTS,) row in CLASSES, -1: no road user
        own       (STATIONS,) slot of the carrier, -1: a mast;  position (STATIONS, 3), yaw (STATIONS,) of the sensors
        speed     (STATIONS, 2) velocity of the sensors;  half_field, reach, fade (STATIONS,);  upper, lower (STATIONS,)
        """
        assets = self._assets
        place = int(rng.integers(len(assets.lanes)))
        lanes = assets.lanes[place]
        driving = np.flatnonzero(lanes[:, 4] == 0)
        lane = int(rng.choice(driving))
        center = lanes[lane, :2].copy()
        away = np.hypot(*(lanes[:, :2] - center).T)
        near = np.flatnonzero(away < _SPREAD)
        pace = float(rng.choice(_FASTEST))
        entries: list[tuple[float, ...]] = []
        boxes = np.empty((0, 5))

        def add(mesh: int, x: float, y: float, heading: float, speed: float, scale: tuple[float, float, float],
                low: float = 0.0, *, solid: bool = True) -> bool:  # fmt: skip
            nonlocal boxes
            length, width, height = (float(a) * b for a, b in zip(assets.sizes[mesh], scale, strict=True))
            box = np.array([x, y, length + 0.2, width + 0.2, heading])
            if solid and overlaps(box, boxes):
                return False
            if solid:
                boxes = np.concatenate([boxes, box[None]])
            velocity = speed * math.cos(heading), speed * math.sin(heading)
            entries.append((mesh, x, y, low + height / 2.0, heading, *scale, *velocity, length, width, height))
            return True

        def body(lane: int, shape: str, *, straight: bool = False) -> bool:
            x, y, heading, width, kind = lanes[lane].tolist()
            mesh = int(rng.choice(self._shapes[shape]))
            aside = float(rng.normal(0.0, 0.12)) * width
            x, y = x - center[0] - math.sin(heading) * aside, y - center[1] + math.cos(heading) * aside
            person = shape == "pedestrian"
            turned = not straight and rng.random() < (0.95 if person else 0.1)
            heading += float(rng.uniform(-math.pi, math.pi)) if turned else float(rng.normal(0.0, 0.06))
            fastest = {"pedestrian": 2.5, "bicycle": 7.0}.get(shape, pace)
            stands = kind == 1 or shape in ("rsu", "box") or rng.random() < (0.7 if turned and not person else 0.3)
            scale = tuple(rng.uniform(0.95, 1.05, 3).tolist()) if shape != "rsu" else (1.0, 1.0, 1.0)
            return add(mesh, x, y, heading, 0.0 if stands else float(rng.uniform(0.5, fastest)), scale)

        def add_row(lane: int, shape: str) -> None:
            x, y, heading = lanes[lane, :3].tolist()
            mesh = int(rng.choice(self._shapes[shape]))
            abreast = rng.random() < 0.25
            step = float(assets.sizes[mesh, 1 if abreast else 0] + rng.uniform(0.5, 5.0))
            direction = heading + (math.pi / 2.0 if abreast else 0.0)
            speed = 0.0 if abreast or rng.random() < 0.7 else float(rng.uniform(0.5, pace))
            for number in range(int(rng.integers(3, 9))):
                aside, turn = float(rng.normal(0.0, 0.1)), float(rng.normal(0.0, 0.02))
                along = number * step + float(rng.normal(0.0, 0.1))
                add(mesh, x - center[0] + along * math.cos(direction) - aside * math.sin(direction),
                    y - center[1] + along * math.sin(direction) + aside * math.cos(direction),
                    heading + turn, speed, (1.0, 1.0, 1.0))  # fmt: skip

        stations = []
        for number in range(STATIONS):
            mast = number > 0 and rng.random() < 0.45
            for _ in range(20):
                if number == 0:
                    start = lane
                else:
                    kinds = lanes[near, 4] != 0 if mast else lanes[near, 4] <= 1
                    rows = near[kinds & (away[near] > 7.0) & (away[near] < 55.0)]
                    start = int(rng.choice(rows if len(rows) else near))
                if mast:
                    x, y, heading = (lanes[start, :3] - (*center, 0.0)).tolist()
                    x, y = (np.array([x, y]) + rng.uniform(-1.5, 1.5, 2)).tolist()
                    tall = float(rng.uniform(2.8, 7.5))
                    mesh = int(rng.choice(self._shapes["rsu"]))
                    if add(mesh, x, y, heading, 0.0, (1.0, 1.0, tall / float(assets.sizes[mesh, 2]))):
                        yaw = heading + float(rng.uniform(-math.pi, math.pi))
                        half = math.radians(float(rng.choice(SELDOM_FIELDS))) / 2.0
                        stations.append((-1, x, y, tall, yaw, 0.0, 0.0, half))
                        break
                else:
                    shape = str(
                        rng.choice(["car", "van", "truck", "bus", "firetruck"], p=[0.7, 0.12, 0.08, 0.06, 0.04])
                    )
                    if body(start, shape, straight=True):
                        _, x, y, _, heading, *_, vx, vy, length, _, height = entries[-1]
                        front = rng.random() < 0.25
                        ahead, up = (
                            (length / 2.0 + 0.06, 1.0) if front else (float(rng.uniform(-0.9, 0.3)), height + 0.35)
                        )
                        half = math.radians(float(rng.choice(FIELDS if front else SELDOM_FIELDS))) / 2.0
                        stations.append((
                            len(entries) - 1, x + ahead * math.cos(heading), y + ahead * math.sin(heading), up, heading,
                            vx, vy, half,
                        ))  # fmt: skip
                        break
            else:  # all tried positions are occupied: a mast anywhere
                angle, far = rng.uniform(-math.pi, math.pi), rng.uniform(8.0, 50.0)
                x, y = far * math.cos(angle), far * math.sin(angle)
                stations.append((-1, x, y, 6.0, float(angle), 0.0, 0.0, math.pi))
        weight = np.where(lanes[near, 4] == 0, 1.0, 0.5) * np.exp(-away[near] / float(rng.choice([15.0, 30.0, 1e3])))
        weight /= weight.sum()
        if rng.random() < _ROWS:
            add_row(int(rng.choice(near, p=weight)), str(rng.choice(["car", "van", "ambulance", "truck", "bus"])))
        for chosen in rng.choice(near, int(rng.integers(4, 46)), p=weight).tolist():
            odds = _ODDS[int(lanes[chosen, 4])]
            shape = str(rng.choice(list(odds), p=np.array(list(odds.values())) / sum(odds.values())))
            body(int(chosen), shape)
        del entries[38:]
        houses = assets.houses[place]
        houses = houses[np.hypot(*(houses[:, :2] - center).T) < 95.0][:14]
        unit = int(self._shapes["unit"][0])
        for x, y, length, width, height, yaw in houses.tolist():
            add(unit, x - center[0], y - center[1], yaw, 0.0, (length, width, height), solid=False)
        beside = near[lanes[near, 4] != 0]
        for chosen in rng.choice(beside if len(beside) else near, int(rng.integers(0, 8))).tolist():
            x, y, heading = lanes[chosen, :3].tolist()
            x, y = x - center[0] + rng.uniform(-3.0, 3.0), y - center[1] + rng.uniform(-3.0, 3.0)
            self._thing(rng, add, unit, float(x), float(y), heading)
        del entries[SLOTS:]
        table = np.zeros((SLOTS, 13))
        table[: len(entries)] = entries
        reach = float(rng.choice([50.0, 100.0]))
        usual = rng.random(STATIONS) < 0.6
        stand = np.array(stations)
        return {
            "bodies": np.column_stack([table[:, :4], np.cos(table[:, 4]), np.sin(table[:, 4]), table[:, 5:8]]),
            "count": np.array(float(len(entries))),
            "velocity": table[:, 8:10],
            "boxes": np.column_stack([table[:, 1:4], table[:, 10:13], table[:, 4]]),
            "classes": np.where(np.arange(SLOTS) < len(entries), assets.classes[table[:, 0].astype(int)], -1).astype(
                float
            ),
            "own": stand[:, 0],
            "position": stand[:, 1:4],
            "yaw": stand[:, 4],
            "speed": stand[:, 5:7],
            "half_field": stand[:, 7],
            "reach": np.full(STATIONS, reach),
            "fade": np.full(STATIONS, float(rng.choice([0.0, 0.0, 0.0, 0.01, 0.03]))),
            "upper": np.radians(np.where(usual, 10.0, rng.uniform(2.0, 15.0, STATIONS))),
            "lower": np.radians(np.where(usual, -30.0, rng.uniform(-35.0, -15.0, STATIONS))),
        }

    @staticmethod
    def _thing(rng: np.random.Generator, add: Any, unit: int, x: float, y: float, heading: float) -> None:
        """Add a tree, pole, barrier or hedge."""
        kind = int(rng.integers(4))
        if kind == 0:
            trunk, crown = float(rng.uniform(0.2, 0.5)), float(rng.uniform(2.0, 4.5))
            if add(unit, x, y, heading, 0.0, (trunk, trunk, 3.0)):
                add(unit, x, y, heading, 0.0, (crown, crown, 4.0), float(rng.uniform(1.8, 3.0)), solid=False)
        elif kind == 1:
            add(unit, x, y, heading, 0.0, (0.15, 0.15, float(rng.uniform(2.5, 8.0))))
        elif kind == 2:
            add(unit, x, y, heading, 0.0, (float(rng.uniform(2.0, 10.0)), 0.3, float(rng.uniform(0.6, 1.1))))
        else:
            add(unit, x, y, heading, 0.0, tuple(rng.uniform((0.6, 0.5, 0.5), (4.0, 1.5, 1.8)).tolist()))

    def batch(self, seed: tuple[int, ...], scenes: int) -> dict[str, Any]:
        """Return scenes as arrays (scenes, ...), all with the same numbers of rings and columns."""
        rng = np.random.default_rng(seed)
        rings, columns = PATTERNS[int(rng.choice(len(PATTERNS), p=PATTERN_ODDS))]
        made = [self.scene(rng) for _ in range(scenes)]
        arrays: dict[str, Any] = {
            name: np.stack([scene[name] for scene in made]).astype(np.float32) for name in made[0]
        }
        return {**arrays, "rings": rings, "columns": columns}
