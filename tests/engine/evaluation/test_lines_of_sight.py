"""Lines of sight from frames, compared with the rays of the truth sensor in the world."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from eidrive_scenario.evaluation.lines_of_sight import LinesOfSight
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.settings import TruthSettings
from eidrive_scenario.sensing.truth import TruthSensor
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

ROAD = Path(__file__).parents[3] / "xosc" / "roads" / "coop_1.xodr"
RANGE = 50.0
BODIES = {"car": (4.6, 1.8, 1.5), "truck": (8.5, 2.5, 3.5), "pedestrian": (0.5, 0.5, 1.75)}


def spec(name: str, category: str) -> ActorSpec:
    length, width, height = BODIES[category]
    wheelbase = 0.0 if category == "pedestrian" else 2.7
    return ActorSpec(name, category, category, (length, width, height), (0.0, 0.0, height / 2.0), wheelbase=wheelbase)


def place(world: World, rng: random.Random, on_road: bool) -> list[ActorSpec]:
    """Add a car and up to ten actors without overlap, on the lanes of the roads or anywhere."""
    specs: list[ActorSpec] = []
    taken: list[tuple[float, float]] = []
    for row in range(11):
        if on_road and rng.random() < 0.5:
            x, y, yaw = rng.uniform(-60.0, 15.0), rng.choice((0.0, 3.5)), rng.choice((0.0, math.pi))
        elif on_road:
            x, y, yaw = rng.choice((30.0, 33.5)), rng.uniform(20.0, 60.0), math.pi / 2.0
        else:
            x, y, yaw = rng.uniform(-30.0, 30.0), rng.uniform(-30.0, 30.0), rng.uniform(-3.0, 3.0)
        if all(
            abs(x - other) > 9.0 or abs(y - aside) > (3.0 if on_road and y < 4.0 else 9.0) for other, aside in taken
        ):
            specs.append(spec(f"A{row}", rng.choice(list(BODIES)) if row else "car"))
            taken.append((x, y))
            world.add(specs[-1], Placement(x, y, yaw=yaw))
    return specs


@pytest.mark.parametrize("with_roads", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_sight_agrees_with_the_truth_sensor(seed: int, with_roads: bool) -> None:
    roads = RoadNetwork.load(ROAD) if with_roads else None
    world = World(roads, dt=0.05)
    try:
        specs = place(world, random.Random(seed), with_roads)
        view = world.view()
        sight = LinesOfSight(roads)
        for row, one in enumerate(specs):
            seen = TruthSensor(TruthSettings(range=RANGE), one).read(world, view, row).names
            assert {view.names[other] for other in sight.visible(view, row, RANGE)} == set(seen)
    finally:
        world.close()
