"""Places to test on, read by the sensors of stations: the library's scenes as they are played, and random ones."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eidrive_scenario.driving.settings import is_agent_controller
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.randomness import generator
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.settings import AnySensorSettings, CameraSettings, LidarSettings
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.weather import Weather
from training.labels import Label, actor_labels
from training.random_roads import random_place
from training.random_scene import Spots, View, random_actor, random_traffic

LIBRARY = ("coop/scenario_1", "coop/scenario_2")
EVERY = 10
"""Ticks from one picture of a scenario to the next: half a second."""


@dataclass(frozen=True)
class Seen:
    """What one station's camera and LiDAR gave, and what was there: the labels are of the only camera."""

    readings: Readings
    labels: list[Label]
    weather: str
    installation: DetectorContext


def usual_sensors() -> dict[str, AnySensorSettings]:
    """A camera of 800 x 600 pixels and a LiDAR, both as they are without any settings."""
    return {"camera": CameraSettings(), "lidar": LidarSettings()}


def library_scenes(weathers: Sequence[Weather], scenarios: Sequence[str] = LIBRARY) -> Iterator[Seen]:
    """What every station of the library's scenarios sees, each half second, in each weather; driven by the oracle."""
    for name in scenarios:
        for weather in weathers:
            scenario = load_for_seed(resolve_scenario(name), 1, {})
            with Simulation(scenario, seed=1, settings=RunSettings(channel="ideal")) as simulation:
                world = simulation.world
                stations = [name for name, own in scenario.controllers.items() if any(map(is_agent_controller, own))]
                end, tick = None, 0
                rigs: dict[str, Rig] = {}
                while end is None:
                    world.set_weather(weather)
                    if tick % EVERY == 0:
                        specs = {actor: world.spec(actor) for actor in world.names}
                        for actor in stations:
                            if actor in specs and actor not in rigs:
                                rigs[actor] = Rig(specs[actor], usual_sensors(), seed=1)
                        yield from _read(world, rigs, specs, simulation.roads, weather.name)
                    _, end = simulation.tick()
                    tick += 1


def random_scenes(
    seed: int,
    split: str,
    worlds: int,
    weather: Weather,
    each: int = 2,
    sensors: Mapping[str, AnySensorSettings] | None = None,
) -> Iterator[Seen]:
    """What a car with the usual sensors, or other ones named `camera` and `lidar`, sees in random traffic."""
    sensors = sensors or usual_sensors()
    for number in range(worlds):
        rng = generator(seed, "training data", split, number)
        with tempfile.TemporaryDirectory() as folder:
            place = random_place(rng, Path(folder))
        spots = Spots.of(place.roads)
        with World(place.roads) as world:
            place.build_houses(world)
            world.set_weather(weather)
            for _ in range(each):
                for name in list(world.names):
                    world.remove(name)
                spec, placement = _carrier(rng, spots)
                world.add(spec, placement)
                pose = mounting(CameraSettings(), spec, "front").camera_pose(world.view(), 0)
                for other, there in random_traffic(rng, spots, View(CameraSettings(), pose, (spec, placement))):
                    world.add(other, there)
                specs = {actor: world.spec(actor) for actor in world.names}
                rig = Rig(spec, dict(sensors), seed=seed)
                yield from _read(world, {spec.name: rig}, specs, place.roads, weather.name, sensors)


def _carrier(rng: np.random.Generator, spots: Spots) -> tuple[ActorSpec, Placement]:
    row = int(rng.choice(np.flatnonzero(spots.kinds == "driving")))
    x, y, z, heading = spots.poses[row].tolist()
    return random_actor(rng, "Carrier", "car"), Placement(x, y, z, heading)


def _read(
    world: World,
    rigs: dict[str, Rig],
    specs: dict[str, ActorSpec],
    roads: RoadNetwork | None,
    weather: str,
    sensors: Mapping[str, AnySensorSettings] | None = None,
) -> Iterator[Seen]:
    view = world.view()
    for name, readings in read_all(list(rigs.values()), world, view).items():
        labels = actor_labels(readings.cameras["camera"], view, specs, (name,))
        installation = DetectorContext(specs[name], dict(sensors or usual_sensors()), roads, 1)
        yield Seen(readings, labels, weather, installation)
