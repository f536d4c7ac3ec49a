"""Tests of swarms, sources, sinks and areas: number and positions of cars."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from eidrive_scenario.geometry import box_distance
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import (
    Area,
    BackgroundTraffic,
    Changes,
    Participant,
    Population,
    Sink,
    Source,
    Swarm,
    polygon,
    sites_within_radius,
)
from eidrive_scenario.traffic.idm import IntelligentDriver
from eidrive_scenario.traffic.spawning.bodies import TrafficMix
from eidrive_scenario.traffic.spawning.generators import TrafficGenerator
from eidrive_scenario.traffic.spawning.population import CentralObject
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

Street = Callable[..., RoadNetwork]
ViewOf = Callable[..., WorldView]

DT = 0.1


class Cars(TrafficMix):
    """Mix with one kind of car."""

    def __init__(self, spec: ActorSpec) -> None:
        self._spec = spec

    def draw(self, rng: np.random.Generator) -> Participant:
        return Participant(self._spec, IntelligentDriver())

    @property
    def categories(self) -> frozenset[str]:
        return frozenset((self._spec.category,))


class Scene:
    """Street with a moving entity and background traffic."""

    def __init__(self, roads: RoadNetwork, view_of: ViewOf, spec: ActorSpec, *, seed: int = 1) -> None:
        self.ego = Placement(1000.0, -1.75, speed=10.0)
        self._view_of = view_of
        self.spec = spec
        self.tick = 0
        population = Population(
            roads,
            seed=seed,
            center=lambda name: (
                CentralObject(self.ego.x, self.ego.y, self.ego.yaw, self.ego.speed) if name == "Ego" else None
            ),
            taken=frozenset({"swarm.0003"}),
        )
        self.traffic = BackgroundTraffic(population)
        self.placements: dict[str, Placement] = {}

    @property
    def mixture(self) -> TrafficMix:
        return Cars(self.spec)

    def start(self, instance: TrafficGenerator) -> None:
        self.traffic.start(instance)

    def run(self, seconds: float) -> Iterator[Changes]:
        for _ in range(round(seconds / DT)):
            view = self._view_of({"Ego": self.ego} | self.placements, self.tick * DT, self.tick)
            self.before = view
            changes = self.traffic.step(view, DT)
            yield changes
            self.placements = dict(changes.placements)
            self.tick += 1
            self.ego = replace(self.ego, x=self.ego.x + self.ego.speed * DT)


@pytest.fixture
def make_scene(street: Street, view_of: ViewOf, car: Callable[[str], ActorSpec]) -> Callable[..., Scene]:
    def make(left: int = 2, right: int = 2, *, seed: int = 1, length: float = 4000.0) -> Scene:
        return Scene(street(left, right, length=length), view_of, car("car"), seed=seed)

    return make


def swarm(scene: Scene, **given: object) -> Swarm:
    settings: dict[str, object] = {
        "center": "Ego",
        "inner": 50.0,
        "major": 300.0,
        "minor": 100.0,
        "offset": 20.0,
        "count": 30,
        "mixture": scene.mixture,
    }
    instance = Swarm("swarm", scene.traffic.key("swarm"), **(settings | given))  # type: ignore[arg-type]
    scene.start(instance)
    return instance


def test_swarm_is_complete_in_first_step_and_keeps_its_number(make_scene: Callable[..., Scene]) -> None:
    """Cars may be outside the ellipse in the step in which they leave it, and are missing in the next one."""
    scene = make_scene()
    instance = swarm(scene)
    counts = []
    for number, changes in enumerate(scene.run(60.0)):
        middle = scene.ego.x + 20.0
        for name, (_, place) in changes.additions.items():
            share = math.hypot((place.x - middle) / 300.0, (place.y + 1.75) / 100.0)
            assert math.hypot(place.x - middle, place.y + 1.75) >= 50.0
            assert share <= 1.0
            assert number == 0 or share > 0.5, name
        inside = [math.hypot((p.x - middle) / 300.0, (p.y + 1.75) / 100.0) for p in changes.placements.values()]
        assert all(share < 1.0 + 3.0 / 300.0 for share in inside)
        assert len(instance.members) == len(scene.traffic.fleet) <= 30
        counts.append(len(instance.members))
    assert counts[0] == 30
    assert min(counts) >= 27
    assert sum(count == 30 for count in counts) > 0.8 * len(counts)


def test_car_names_contain_traffic_name_and_are_unique(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    swarm(scene, count=5)
    seen: list[str] = []
    for changes in scene.run(40.0):
        seen += changes.additions
        assert not set(changes.removals) & set(changes.placements)
    assert seen[:5] == ["swarm.0001", "swarm.0002", "swarm.0004", "swarm.0005", "swarm.0006"]
    assert len(seen) == len(set(seen))


def test_spawned_cars_do_not_overlap_others(make_scene: Callable[..., Scene]) -> None:
    """Cars have a gap of at least 0.5 m to the entity and to each other."""
    scene = make_scene(1, 2)
    swarm(scene, inner=0.0, count=60, offset=0.0)
    for changes in scene.run(20.0):
        fleet = scene.traffic.fleet
        if changes.additions:
            boxes = np.concatenate([scene._view_of({"Ego": scene.ego}).boxes, scene._view_of(scene.placements).boxes])
            for _, place in changes.additions.values():
                (mine,) = scene._view_of({"new": place}).boxes
                assert min(box_distance(mine, other) for other in boxes) > 0.49
    assert len(fleet) > 40


def test_swarm_draws_directions_of_travel_by_weight(make_scene: Callable[..., Scene]) -> None:
    """Of 40 cars with weights 3 : 1, the mean is 30 and the standard deviation 2.7."""
    scene = make_scene()
    swarm(scene, count=40, directions=(3.0, 1.0))
    changes = next(scene.run(DT))
    same = sum(math.cos(place.yaw) > 0.0 for _, place in changes.additions.values())
    assert len(changes.additions) == 40
    assert 22 <= same <= 38
    only = make_scene()
    swarm(only, count=20, directions=(0.0, 1.0))
    assert all(math.cos(place.yaw) < 0.0 for _, place in next(only.run(DT)).additions.values())


def test_swarm_draws_sectors_by_weight(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    swarm(scene, count=15, sectors=(0.0, 1.0, 0.0, 0.0), offset=0.0)
    assert all(place.x < scene.ego.x for _, place in next(scene.run(DT)).additions.values())


def test_swarm_draws_initial_speeds_from_its_range(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    swarm(scene, speeds=(12.0, 16.0))
    speeds = [place.speed for _, place in next(scene.run(DT)).additions.values()]
    assert 12.0 <= min(speeds) < 13.5
    assert 14.5 < max(speeds) <= 16.0


def test_swarm_around_absent_entity_spawns_no_cars(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    swarm(scene, center="Absent")
    assert not [changes for changes in scene.run(1.0) if changes.additions]


def test_traffic_depends_on_the_seed_only(make_scene: Callable[..., Scene]) -> None:
    def trace(seed: int, *, company: bool = False) -> list[Placement]:
        scene = make_scene(seed=seed)
        swarm(scene)
        if company:
            swarm(scene, count=0)
        for changes in scene.run(15.0):
            last = changes.placements
        return list(last.values())

    assert trace(1) == trace(1)
    assert trace(1) == trace(1, company=True)
    assert trace(1) != trace(2)


def source(
    scene: Scene, *, rate: float, at: float = 1200.0, radius: float = 10.0, speed: float | None = 12.0
) -> Source:
    lanes, ground = scene.traffic.fleet.lanes, scene.traffic.population.ground
    sites = sites_within_radius(lanes, ground.driving, at, -1.75, radius, None)
    instance = Source(
        "source",
        scene.traffic.key("source"),
        place=(at, -1.75),
        sites=lambda _: sites,
        rate=rate,
        mixture=scene.mixture,
        speed=speed,
        started=0.0,
    )
    scene.start(instance)
    return instance


def test_source_spawns_cars_at_its_rate(make_scene: Callable[..., Scene]) -> None:
    """The period is 2.5 s and the first car is spawned at once: 1 + 59.9 / 2.5 = 24 in a minute."""
    scene = make_scene(0, 2)
    source(scene, rate=0.4)
    times = []
    for changes in scene.run(60.0):
        for _, place in changes.additions.values():
            times.append(scene.tick * DT)
            assert math.hypot(place.x - 1200.0, place.y + 1.75) <= 10.0
            assert place.speed == 12.0
    assert times == pytest.approx([2.5 * n for n in range(24)])


def test_source_without_free_site_delays_cars(make_scene: Callable[..., Scene]) -> None:
    """A car stands at the source for 20 s. The cars that were due meanwhile are spawned afterwards."""
    scene = make_scene(0, 1)
    scene.ego = Placement(1200.0, -1.75, speed=0.0)
    source(scene, rate=0.2, radius=2.0)
    times: list[float] = []
    for changes in scene.run(120.0):
        times += [scene.tick * DT] * len(changes.additions)
        if scene.tick * DT >= 20.0:
            scene.ego = Placement(0.0, 50.0)
    assert times[0] == pytest.approx(20.1)
    assert len(times) == 24
    assert np.min(np.diff(times)) > 1.0


@pytest.mark.parametrize(("rate", "gone"), [(math.inf, 5), (0.5, 3), (0.0, 0)])
def test_sink_removes_nearest_cars_at_its_rate(make_scene: Callable[..., Scene], rate: float, gone: int) -> None:
    """Five cars stand within the radius. Within 4.5 s a rate of 0.5/s removes those at 0, 2 and 4 s."""
    scene = make_scene(0, 1)
    for k in range(7):
        spec = replace(scene.spec, name=f"car{k}")
        row, progress = scene.traffic.fleet.lanes.of(scene.traffic.fleet.lanes.roads.location("1", -1, 500.0 + 10 * k))
        scene.traffic.fleet.add_at(spec, row, progress, desired_speed=1e-6)
    scene.start(Sink("sink", 1, place=(500.0, 0.0), radius=44.0, rate=rate, categories=None))
    removed: list[str] = []
    for changes in scene.run(4.5):
        removed += sorted(changes.removals)
    assert removed == [f"car{k}" for k in range(gone)]


def test_sink_removes_its_categories_only(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene(0, 1)
    lanes = scene.traffic.fleet.lanes
    for k, category in enumerate(("car", "truck")):
        spec = replace(scene.spec, name=category, category=category)
        scene.traffic.fleet.add_at(spec, *lanes.of(lanes.roads.location("1", -1, 500.0 + 10 * k)), desired_speed=1e-6)
    scene.start(Sink("sink", 1, place=(500.0, 0.0), radius=50.0, rate=math.inf, categories=frozenset({"truck"})))
    assert [changes.removals for changes in scene.run(2 * DT)] == [{"truck"}, set()]


def area(scene: Scene, *, continuous: bool, count: int = 20) -> Area:
    outline = [(900.0, -10.0), (1300.0, -10.0), (1300.0, 10.0), (900.0, 10.0)]
    instance = Area(
        "area",
        scene.traffic.key("area"),
        count=count,
        continuous=continuous,
        mixture=scene.mixture,
        covers=polygon(outline),
    )
    scene.start(instance)
    return instance


def test_continuous_area_is_replenished(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    instance = area(scene, continuous=True)
    counts, came = [], 0
    for changes in scene.run(60.0):
        came += len(changes.additions)
        counts.append(len(instance.members))
        assert all(890.0 < place.x < 1310.0 for place in changes.placements.values())
    assert counts[0] == 20
    assert min(counts) >= 18
    assert came > 40


def test_area_without_continuous_is_filled_once(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene()
    instance = area(scene, continuous=False)
    additions = [len(changes.additions) for changes in scene.run(30.0)]
    assert additions[0] == 20
    assert sum(additions[1:]) == 0
    assert not instance.active
    assert len(scene.traffic.fleet) == 20
    assert any(place.x > 1350.0 for place in scene.placements.values())


def test_stopped_generators_spawn_and_remove_no_cars(make_scene: Callable[..., Scene]) -> None:
    scene = make_scene(0, 2)
    source(scene, rate=1.0)
    keeper = swarm(scene, count=5)
    steps = scene.run(60.0)
    for _ in range(50):
        next(steps)
    scene.traffic.stop("source")
    came = [name for _ in range(50) for name in next(steps).additions]
    assert not [name for name in came if name.startswith("source")]
    active = keeper.active
    assert active
    scene.traffic.stop(None)
    assert not keeper.active
    there = len(scene.traffic.fleet)
    for _ in range(100):
        changes = next(steps)
        assert not changes.additions
        assert not changes.removals
    assert len(scene.traffic.fleet) == there
