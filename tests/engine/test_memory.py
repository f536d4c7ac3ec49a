"""Memory over successive runs in one process: what a run allocates is released with it."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.network import KEPT, _loaded
from eidrive_scenario.simulation import RunSettings, Simulation, run_file
from eidrive_scenario.world import World
from eidrive_scenario.world.physics.bullet import bullet, connect, create_triangle_shape, disconnect

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
POSTS = 2000


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A driven car on a road with posts, as `benchmarks/bench_memory.py` writes them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        from bench_memory import write_road, write_scenario

        folder = tmp_path_factory.mktemp("memory")
        path: Path = write_scenario(folder, write_road(folder, POSTS), -1)
    return path


def is_connected(client: int) -> bool:
    return bool(bullet.getConnectionInfo(client)["isConnected"])


@pytest.mark.exhaustive
def test_runs_on_road_with_many_objects_leave_no_objects_behind(scenario: Path) -> None:
    """2,000 posts are 16,000 vertices; of each, pybullet leaked a list per run."""
    counts = []
    for _ in range(4):
        run_file(scenario, settings=RunSettings(time_limit=0.5))
        gc.collect()
        counts.append(len(gc.get_objects()))
    assert counts[3] - counts[1] < 200


def test_triangle_shape_is_met_by_rays_after_its_lists_are_reused() -> None:
    """The second mesh is smaller and lies elsewhere: it must not change the first one."""
    client = connect()
    square = np.array([(0.0, 0.0, 1.0), (4.0, 0.0, 1.0), (4.0, 4.0, 1.0), (0.0, 4.0, 1.0)])
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    try:
        handles = [
            bullet.createMultiBody(0.0, create_triangle_shape(client, square + offset, faces), physicsClientId=client)
            for offset in ((0.0, 0.0, 0.0), (100.0, 0.0, 1.0))
        ]
        starts, ends = [(1.0, 2.0, 9.0), (103.0, 2.0, 9.0)], [(1.0, 2.0, -1.0), (103.0, 2.0, -1.0)]
        hits = bullet.rayTestBatch(starts, ends, physicsClientId=client)
    finally:
        disconnect(client)
    assert [hit[0] for hit in hits] == handles
    assert [hit[3][2] for hit in hits] == pytest.approx([1.0, 2.0], abs=1e-6)


def test_triangle_shape_vertices_are_released() -> None:
    client = connect()
    vertices = np.arange(3000.0).reshape(-1, 3)
    faces = np.arange(999).reshape(-1, 3)
    try:
        create_triangle_shape(client, vertices, faces)
        before = sys.getallocatedblocks()
        for _ in range(10):
            create_triangle_shape(client, vertices, faces)
        assert sys.getallocatedblocks() - before < 1000
    finally:
        disconnect(client)


def test_simulation_dropped_without_close_frees_its_client(scenario: Path) -> None:
    """The next world uses the client, without the bodies of the dropped one."""
    simulation = Simulation(load_scenario(scenario))
    simulation.tick()
    client = simulation.world._client
    assert bullet.getNumBodies(client) > 0
    del simulation
    gc.collect()
    assert bullet.getNumBodies(client) == 0
    with World() as world:
        assert world._client == client


def test_clients_of_worlds_are_freed_but_for_one() -> None:
    worlds = [World() for _ in range(3)]
    clients = [world._client for world in worlds]
    for world in worlds:
        world.close()
    assert sum(is_connected(client) for client in clients) == 1


def test_reused_client_has_no_collision_filter_of_its_former_world() -> None:
    """Boxes of 2 m whose centers are 1 m apart overlap, unless their pair is filtered."""
    contacts = []
    for is_filtered in (True, False):
        client = connect()
        try:
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[1.0, 1.0, 1.0], physicsClientId=client)
            boxes = [
                bullet.createMultiBody(1.0, shape, basePosition=[x, 0.0, 0.0], physicsClientId=client)
                for x in (0.0, 1.0)
            ]
            if is_filtered:
                bullet.setCollisionFilterPair(*boxes, -1, -1, 0, physicsClientId=client)
            bullet.performCollisionDetection(client)
            contacts.append(len(bullet.getContactPoints(*boxes, physicsClientId=client)))
        finally:
            disconnect(client)
    assert contacts[0] == 0
    assert contacts[1] > 0


def test_world_closed_twice_leaves_the_client_of_another_world_alone() -> None:
    """pybullet gives a freed number again."""
    world = World()
    client = world._client
    world.close()
    with World() as other:
        assert other._client == client
        world.close()
        del world
        assert is_connected(client)


def test_road_networks_of_files_are_kept_up_to_a_bound(scenario: Path, tmp_path: Path) -> None:
    text = (scenario.parent / "road.xodr").read_text()
    for number in range(KEPT + 3):
        path = tmp_path / f"{number}.xodr"
        path.write_text(text)
        RoadNetwork.load(path)
    assert _loaded.cache_info().currsize == KEPT
