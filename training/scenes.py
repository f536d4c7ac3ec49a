"""Scenes for evaluation with sensor readings of stations: simulated scenarios of the library, and random scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.weather import Weather
from training.labels import Label, actor_labels
from training.random_roads import random_place
from training.random_scene import random_actor, random_traffic, replace_actors, view_of_carrier

LIBRARY = ("coop/scenario_1", "coop/scenario_2")
SENSORS: dict[str, SensorSettings] = {"camera": CameraSettings(), "lidar": LidarSettings()}
EVERY = 10
"""Ticks between images of a scenario: half a second."""


@dataclass(frozen=True)
class StationScene:
    """Readings of one station with camera and lidar, the labels of its camera image, and boxes (M, 7) of all other
    actors with their categories.
    """

    boxes: Array
    categories: tuple[str, ...]
    readings: Readings
    labels: list[Label]
    weather: str
    context: DetectorContext


def library_scenes(weathers: Sequence[Weather]) -> Iterator[StationScene]:
    """Yield the readings of every station of the library scenarios, each half second, in each weather; driven by the
    oracle."""
    for name in LIBRARY:
        for weather in weathers:
            scenario = load_for_seed(resolve_scenario(name), 1, {})
            with Simulation(scenario, seed=1, settings=RunSettings(channel="ideal")) as simulation:
                world = simulation.world
                stations = [
                    name
                    for name, controllers in scenario.controllers.items()
                    if any(map(is_agent_controller, controllers))
                ]
                end, tick = None, 0
                rigs: dict[str, Rig] = {}
                while end is None:
                    world.set_weather(weather)
                    if tick % EVERY == 0:
                        for actor in stations:
                            if actor in world.names and actor not in rigs:
                                rigs[actor] = Rig(world.spec(actor), SENSORS, seed=1)
                        yield from _read(world, rigs, simulation.roads, weather.name, SENSORS)
                    _, end = simulation.tick()
                    tick += 1


def random_scenes(
    seed: int,
    split: str,
    worlds: int,
    weather: Weather,
    each: int = 2,
    sensors: Mapping[str, SensorSettings] = SENSORS,
) -> Iterator[StationScene]:
    """Yield readings of a car with sensors named `camera` and `lidar`, in random traffic."""
    for number in range(worlds):
        rng = generator(seed, "training data", split, number)
        place = random_place(rng)
        with place.world() as world:
            world.set_weather(weather)
            for _ in range(each):
                placement = Placement(*place.positions.draw(rng))
                carrier = (random_actor(rng, "Carrier", "car"), placement)
                view = view_of_carrier(world, CameraSettings(), carrier)
                replace_actors(world, [carrier, *random_traffic(rng, place.positions, view)])
                rig = Rig(carrier[0], sensors, seed=seed)
                yield from _read(world, {"Carrier": rig}, place.roads, weather.name, sensors)


def _read(
    world: World, rigs: dict[str, Rig], roads: RoadNetwork | None, weather: str, sensors: Mapping[str, SensorSettings]
) -> Iterator[StationScene]:
    view = world.view()
    specs = {name: world.spec(name) for name in world.names}
    for name, readings in read_all(list(rigs.values()), world, view).items():
        labels = actor_labels(readings.cameras["camera"], view, specs, (name,))
        rows = [row for other, row in view.rows.items() if other != name]
        context = DetectorContext(specs[name], dict(sensors), roads, 1)
        categories = tuple(view.categories[row] for row in rows)
        yield StationScene(view.boxes[rows].reshape(-1, 7), categories, readings, labels, weather, context)
