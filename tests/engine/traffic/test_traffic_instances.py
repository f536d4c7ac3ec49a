"""Swarms, sources, sinks and areas: how many cars there are, and where they come and go."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from eidrive_scenario.geometry import boxes_distance
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import (
    Area,
    BackgroundTraffic,
    Changes,
    Participant,
    Sink,
    Source,
    Swarm,
    polygon,
    sites_within_radius,
)
from eidrive_scenario.traffic.idm import IntelligentDriver
from eidrive_scenario.traffic.spawning.bodies import TrafficMix
from eidrive_scenario.traffic.spawning.generators import CentralObject, TrafficGenerator
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

Street = Callable[..., RoadNetwork]
ViewOf = Callable[..., WorldView]

DT = 0.1


class Cars(TrafficMix):
    """Cars of one kind."""

    def __init__(self, spec: ActorSpec) -> None:
        self._spec = spec

    def draw(self, rng: np.random.Generator) -> Participant:
        return Participant(self._spec, IntelligentDriver())

    @property
    def categories(self) -> frozenset[str]:
        return frozenset((self._spec.category,))


class Scene:
    """A street, an entity that drives along it, and what the traffic does around it."""

    def __init__(self, roads: RoadNetwork, view_of: ViewOf, spec: ActorSpec, *, seed: int = 1) -> None:
        self.ego = Placement(1000.0, -1.75, speed=10.0)
        self._view_of = view_of
        self.spec = spec
        self.tick = 0
        self.traffic = BackgroundTraffic(
            roads,
            seed=seed,
            center=lambda name: (
                CentralObject(self.ego.x, self.ego.y, self.ego.yaw, self.ego.speed) if name == "Ego" else None
            ),
            taken=frozenset({"swarm.0003"}),
        )
        self.placements: dict[str, Placement] = {}

    @property
    def mixture(self) -> TrafficMix:
        return Cars(self.spec)

    def start(self, instance: TrafficGenerator) -> None:
        self.traffic.start(instance)

    def play(self, seconds: float) -> Iterator[Changes]:
        for _ in range(round(seconds / DT)):
            view = self._view_of({"Ego": self.ego} | self.placements, self.tick * DT, self.tick)
            self.before = view
            changes = self.traffic.step(view, DT)
            yield changes
            self.placements = dict(changes.placements)
            self.tick += 1
            self.ego = replace(self.ego, x=self.ego.x + self.ego.speed * DT)


@pytest.fixture
def scene(street: Street, view_of: ViewOf, car: Callable[[str], ActorSpec]) -> Callable[..., Scene]:
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


def test_a_swarm_is_there_at_once_and_keeps_its_number_in_the_ellipse(scene: Callable[..., Scene]) -> None:
    """Cars may be outside the ellipse for the one step in which they leave it, and are missing for the next ones."""
    stage = scene()
    instance = swarm(stage)
    counts = []
    for number, changes in enumerate(stage.play(60.0)):
        middle = stage.ego.x + 20.0
        for name, (_, place) in changes.additions.items():
            share = math.hypot((place.x - middle) / 300.0, (place.y + 1.75) / 100.0)
            assert math.hypot(place.x - middle, place.y + 1.75) >= 50.0
            assert share <= 1.0
            assert number == 0 or share > 0.5, name
        inside = [math.hypot((p.x - middle) / 300.0, (p.y + 1.75) / 100.0) for p in changes.placements.values()]
        assert all(share < 1.0 + 3.0 / 300.0 for share in inside)
        assert len(instance.members) == len(stage.traffic.fleet) <= 30
        counts.append(len(instance.members))
    assert counts[0] == 30
    assert min(counts) >= 27
    assert sum(count == 30 for count in counts) > 0.8 * len(counts)


def test_names_come_from_the_traffic_and_are_used_once(scene: Callable[..., Scene]) -> None:
    stage = scene()
    swarm(stage, count=5)
    seen: list[str] = []
    for changes in stage.play(40.0):
        seen += changes.additions
        assert not set(changes.removals) & set(changes.placements)
    assert seen[:5] == ["swarm.0001", "swarm.0002", "swarm.0004", "swarm.0005", "swarm.0006"]
    assert len(seen) == len(set(seen))


def test_nobody_appears_in_anybody(scene: Callable[..., Scene]) -> None:
    """Neither in the entity, nor in each other: half a meter of air at least."""
    stage = scene(1, 2)
    swarm(stage, inner=0.0, count=60, offset=0.0)
    for changes in stage.play(20.0):
        fleet = stage.traffic.fleet
        if changes.additions:
            boxes = np.concatenate([stage._view_of({"Ego": stage.ego}).boxes, stage._view_of(stage.placements).boxes])
            for _, place in changes.additions.values():
                mine = stage._view_of({"new": place}).boxes
                assert boxes_distance(mine, boxes).min() > 0.49
    assert len(fleet) > 40


def test_directions_of_travel_have_their_shares(scene: Callable[..., Scene]) -> None:
    """Of 40 cars with shares 3 : 1, 30 in the mean, 2.7 the standard deviation."""
    stage = scene()
    swarm(stage, count=40, directions=(3.0, 1.0))
    changes = next(stage.play(DT))
    same = sum(math.cos(place.yaw) > 0.0 for _, place in changes.additions.values())
    assert len(changes.additions) == 40
    assert 22 <= same <= 38
    only = scene()
    swarm(only, count=20, directions=(0.0, 1.0))
    assert all(math.cos(place.yaw) < 0.0 for _, place in next(only.play(DT)).additions.values())


def test_sectors_have_their_shares(scene: Callable[..., Scene]) -> None:
    stage = scene()
    swarm(stage, count=15, sectors=(0.0, 1.0, 0.0, 0.0), offset=0.0)
    assert all(place.x < stage.ego.x for _, place in next(stage.play(DT)).additions.values())


def test_a_swarm_starts_with_speeds_of_its_range(scene: Callable[..., Scene]) -> None:
    stage = scene()
    swarm(stage, speeds=(12.0, 16.0))
    speeds = [place.speed for _, place in next(stage.play(DT)).additions.values()]
    assert 12.0 <= min(speeds) < 13.5
    assert 14.5 < max(speeds) <= 16.0


def test_a_swarm_around_nobody_does_nothing(scene: Callable[..., Scene]) -> None:
    stage = scene()
    swarm(stage, center="Nobody")
    assert not [changes for changes in stage.play(1.0) if changes.additions]


def test_the_seed_and_nothing_else_decides(scene: Callable[..., Scene]) -> None:
    def trace(seed: int, *, company: bool = False) -> list[Placement]:
        stage = scene(seed=seed)
        swarm(stage)
        if company:
            swarm(stage, count=0)
        for changes in stage.play(15.0):
            last = changes.placements
        return list(last.values())

    assert trace(1) == trace(1)
    assert trace(1) == trace(1, company=True)
    assert trace(1) != trace(2)


def source(
    stage: Scene, *, rate: float, at: float = 1200.0, radius: float = 10.0, speed: float | None = 12.0
) -> Source:
    lanes, ground = stage.traffic.fleet.lanes, stage.traffic.ground
    sites = sites_within_radius(lanes, ground.driving, at, -1.75, radius, None)
    instance = Source(
        "source",
        stage.traffic.key("source"),
        place=(at, -1.75),
        sites=lambda _: sites,
        rate=rate,
        mixture=stage.mixture,
        speed=speed,
        started=0.0,
    )
    stage.start(instance)
    return instance


def test_a_source_makes_cars_at_its_rate(scene: Callable[..., Scene]) -> None:
    """One every 2.5 s, the first at once: 1 + 59.9 / 2.5 = 24 in a minute."""
    stage = scene(0, 2)
    source(stage, rate=0.4)
    times = []
    for changes in stage.play(60.0):
        for _, place in changes.additions.values():
            times.append(stage.tick * DT)
            assert math.hypot(place.x - 1200.0, place.y + 1.75) <= 10.0
            assert place.speed == 12.0
    assert times == pytest.approx([2.5 * n for n in range(24)])


def test_who_finds_no_place_waits_and_none_is_lost(scene: Callable[..., Scene]) -> None:
    """A car that stands at the source for 20 s; what was due meanwhile comes after, one behind the other."""
    stage = scene(0, 1)
    stage.ego = Placement(1200.0, -1.75, speed=0.0)
    source(stage, rate=0.2, radius=2.0)
    times: list[float] = []
    for changes in stage.play(120.0):
        times += [stage.tick * DT] * len(changes.additions)
        if stage.tick * DT >= 20.0:
            stage.ego = Placement(0.0, 50.0)
    assert times[0] == pytest.approx(20.1)
    assert len(times) == 24
    assert np.min(np.diff(times)) > 1.0


@pytest.mark.parametrize(("rate", "gone"), [(math.inf, 5), (0.5, 3), (0.0, 0)])
def test_a_sink_takes_cars_at_its_rate_the_nearest_first(scene: Callable[..., Scene], rate: float, gone: int) -> None:
    """Five cars stand in its radius; within 4.5 s a rate of 0.5/s takes those at 0, 2 and 4 s."""
    stage = scene(0, 1)
    for k in range(7):
        spec = replace(stage.spec, name=f"car{k}")
        row, progress = stage.traffic.fleet.lanes.of(stage.traffic.fleet.lanes.roads.location("1", -1, 500.0 + 10 * k))
        stage.traffic.fleet.add_at(spec, row, progress, desired_speed=1e-6)
    stage.start(Sink("sink", 1, place=(500.0, 0.0), radius=44.0, rate=rate, categories=None))
    removed: list[str] = []
    for changes in stage.play(4.5):
        removed += sorted(changes.removals)
    assert removed == [f"car{k}" for k in range(gone)]


def test_a_sink_takes_only_the_categories_that_it_is_for(scene: Callable[..., Scene]) -> None:
    stage = scene(0, 1)
    lanes = stage.traffic.fleet.lanes
    for k, category in enumerate(("car", "truck")):
        spec = replace(stage.spec, name=category, category=category)
        stage.traffic.fleet.add_at(spec, *lanes.of(lanes.roads.location("1", -1, 500.0 + 10 * k)), desired_speed=1e-6)
    stage.start(Sink("sink", 1, place=(500.0, 0.0), radius=50.0, rate=math.inf, categories=frozenset({"truck"})))
    assert [changes.removals for changes in stage.play(2 * DT)] == [{"truck"}, set()]


def area(stage: Scene, *, continuous: bool, count: int = 20) -> Area:
    outline = [(900.0, -10.0), (1300.0, -10.0), (1300.0, 10.0), (900.0, 10.0)]
    instance = Area(
        "area",
        stage.traffic.key("area"),
        count=count,
        continuous=continuous,
        mixture=stage.mixture,
        covers=polygon(outline),
    )
    stage.start(instance)
    return instance


def test_an_area_is_kept_full(scene: Callable[..., Scene]) -> None:
    stage = scene()
    instance = area(stage, continuous=True)
    counts, came = [], 0
    for changes in stage.play(60.0):
        came += len(changes.additions)
        counts.append(len(instance.members))
        assert all(890.0 < place.x < 1310.0 for place in changes.placements.values())
    assert counts[0] == 20
    assert min(counts) >= 18
    assert came > 40


def test_an_area_is_filled_once(scene: Callable[..., Scene]) -> None:
    stage = scene()
    instance = area(stage, continuous=False)
    additions = [len(changes.additions) for changes in stage.play(30.0)]
    assert additions[0] == 20
    assert sum(additions[1:]) == 0
    assert not instance.active
    assert len(stage.traffic.fleet) == 20
    assert any(place.x > 1350.0 for place in stage.placements.values())


def test_who_is_stopped_neither_makes_nor_takes_cars(scene: Callable[..., Scene]) -> None:
    stage = scene(0, 2)
    source(stage, rate=1.0)
    keeper = swarm(stage, count=5)
    steps = stage.play(60.0)
    for _ in range(50):
        next(steps)
    stage.traffic.stop("source")
    came = [name for _ in range(50) for name in next(steps).additions]
    assert not [name for name in came if name.startswith("source")]
    assert keeper.active
    stage.traffic.stop(None)
    assert not keeper.active
    there = len(stage.traffic.fleet)
    for _ in range(100):
        changes = next(steps)
        assert not changes.additions
        assert not changes.removals
    assert len(stage.traffic.fleet) == there
