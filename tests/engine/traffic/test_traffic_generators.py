"""Tests of sources, sinks and areas: number and positions of cars."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from background_scene import DT, Scene, swarm
from fleet_scene import car

from eidrive_scenario.traffic import (
    Area,
    Sink,
    Source,
    polygon,
    sites_within_radius,
)
from eidrive_scenario.world.actor import Placement


def source(
    scene: Scene, *, rate: float, at: float = 1200.0, radius: float = 10.0, speed: float | None = 12.0
) -> Source:
    lanes, ground = scene.traffic.fleet.lanes, scene.traffic.population.ground
    sites = sites_within_radius(lanes, ground.driving, at, -1.75, radius, None)
    instance = Source(
        "source",
        scene.traffic.key("source"),
        sites=lambda _: sites,
        rate=rate,
        mixture=scene.mixture,
        speed=speed,
        started=0.0,
    )
    scene.start(instance)
    return instance


def test_source_spawns_cars_at_its_rate() -> None:
    """The period is 2.5 s and the first car is spawned at once: 1 + 59.9 / 2.5 = 24 in a minute."""
    scene = Scene(0, 2)
    source(scene, rate=0.4)
    times = []
    for changes in scene.run(60.0):
        for _, place in changes.additions.values():
            times.append(scene.tick * DT)
            assert math.hypot(place.x - 1200.0, place.y + 1.75) <= 10.0
            assert place.speed == 12.0
    assert times == pytest.approx([2.5 * n for n in range(24)])


def test_car_from_standstill_drives_on_a_lane_without_limit() -> None:
    """With 1 m/s² and a desired speed of 13.9 m/s it covers less than 10²/2 m and more than half of it in 10 s."""
    scene = Scene(0, 1)
    source(scene, rate=0.05, speed=0.0, radius=0.0)
    placements = [changes.placements["source.0001"] for changes in scene.run(10.0)]
    assert 25.0 < placements[-1].x - placements[0].x < 50.0


def test_source_without_free_site_delays_cars() -> None:
    """A car stands at the source for 20 s. The cars that were due meanwhile are spawned afterwards."""
    scene = Scene(0, 1)
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
def test_sink_removes_nearest_cars_at_its_rate(rate: float, gone: int) -> None:
    """Five cars stand within the radius. Within 4.5 s a rate of 0.5/s removes those at 0, 2 and 4 s."""
    scene = Scene(0, 1)
    for k in range(7):
        spec = replace(car("car"), name=f"car{k}")
        row, progress = scene.traffic.fleet.lanes.of(scene.traffic.fleet.lanes.roads.location("1", -1, 500.0 + 10 * k))
        scene.traffic.fleet.add_at(spec, row, progress, desired_speed=1e-6)
    scene.start(Sink("sink", 1, position=(500.0, 0.0), radius=44.0, rate=rate, categories=None))
    removed: list[str] = []
    for changes in scene.run(4.5):
        removed += sorted(changes.removals)
    assert removed == [f"car{k}" for k in range(gone)]


def test_sink_removes_its_categories_only() -> None:
    scene = Scene(0, 1)
    lanes = scene.traffic.fleet.lanes
    for k, category in enumerate(("car", "truck")):
        spec = replace(car("car"), name=category, category=category)
        scene.traffic.fleet.add_at(spec, *lanes.of(lanes.roads.location("1", -1, 500.0 + 10 * k)), desired_speed=1e-6)
    scene.start(Sink("sink", 1, position=(500.0, 0.0), radius=50.0, rate=math.inf, categories=frozenset({"truck"})))
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


def test_continuous_area_is_replenished() -> None:
    scene = Scene()
    instance = area(scene, continuous=True)
    counts, came = [], 0
    for changes in scene.run(60.0):
        came += len(changes.additions)
        counts.append(len(instance.members))
        assert all(890.0 < place.x < 1310.0 for place in changes.placements.values())
    assert counts[0] == 20
    assert min(counts) >= 18
    assert came > 40


def test_area_without_continuous_is_filled_once() -> None:
    scene = Scene()
    instance = area(scene, continuous=False)
    additions = [len(changes.additions) for changes in scene.run(30.0)]
    assert additions[0] == 20
    assert sum(additions[1:]) == 0
    assert not instance.active
    assert len(scene.traffic.fleet) == 20
    assert any(place.x > 1350.0 for place in scene.placements.values())


def test_area_that_is_stopped_before_its_first_step_remains_empty() -> None:
    scene = Scene()
    scene.start(Area("area", 1, 20, scene.mixture, False, lambda sites: np.ones(len(sites), dtype=bool)))
    scene.traffic.stop("area")
    assert [len(changes.additions) for changes in scene.run(1.0)] == [0] * 10


def test_stopped_generators_spawn_and_remove_no_cars() -> None:
    scene = Scene(0, 2)
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
