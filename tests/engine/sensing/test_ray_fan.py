"""Hits of lidars against ray casts of pybullet, another implementation, in several scenes; kernels against formulas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml, superelevation_xml
from sample_car import make_car

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.ray_fan import FanHits, RayFan
from eidrive_scenario.sensing.settings import LidarSettings, Mount
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import Appearance, Visibility
from eidrive_scenario.world.surfaces import Surfaces
from eidrive_scenario.world.view import NOTHING

OBJECT = (
    '<object type="{kind}" id="{number}" name="" s="{s}" t="{t}" zOffset="0" length="{length}" width="{width}" '
    'height="{height}" orientation="none" hdg="{hdg}"/>'
)
BESIDE = 2e-3
"""Distance at the hit [m], or angle [rad] if that is more, of rays that are compared where hits differ: pybullet also
hits a box that a ray passes within a millimeter, and a millimeter too early."""
RANGE = 80.0
MAST = ActorSpec("Mast", "rsu", "misc", (0.5, 0.5, 5.0), (0.0, 0.0, 2.5))


def roads(rng: np.random.Generator, profiles: str = "") -> RoadNetwork:
    """Return a road of 200 m with posts, trees, long barriers and buildings."""
    objects = ""
    for number in range(30):
        kind = ("pole", "tree", "barrier", "building", "vegetation")[number % 5]
        length = rng.uniform(20.0, 60.0) if kind == "barrier" else rng.uniform(0.2, 12.0)
        objects += OBJECT.format(
            kind=kind, number=number, s=rng.uniform(5.0, 195.0), t=rng.choice([-1, 1]) * rng.uniform(5.0, 40.0),
            length=length, width=rng.uniform(0.2, 4.0), height=rng.uniform(0.5, 12.0), hdg=rng.uniform(-3.0, 3.0),
        )  # fmt: skip
    extra = f"<objects>{objects}</objects>"
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, extra=extra, profiles=profiles)))


@pytest.fixture
def bodies_are_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let lidars see the boxes of actors, as pybullet does, instead of their meshes."""

    def box(spec: ActorSpec, _: str) -> Surfaces:
        (x, y, z), size = spec.offset, spec.size
        return Surfaces.of_boxes(np.array([(x, y, z - size[2] / 2.0, *size, 0.0)]))

    monkeypatch.setattr("eidrive_scenario.sensing.lidar.body_surfaces", box)


def compare(world: World, own: str, sensor: str = "lidar", **settings: Any) -> set[int]:
    """Compare the hits of a lidar of an actor with those of pybullet, and return the hit rows."""
    view, row = world.view(), world.view().row(own)
    lidar = Lidar(LidarSettings(points_per_second=32 * 180 * 20, range=RANGE, **settings), world.spec(own), sensor)
    pose = lidar.mounting.pose(view, row)
    columns = lidar._columns(view.time)
    hits = lidar._hits(columns, pose, world, view, row)
    rays = lidar._directions(columns) @ pose[:3, :3].T
    rows, distance, facing = hits.rows.ravel(), hits.distance.ravel(), hits.brightness.ravel()
    ignore = () if world.spec(own).has_wheels else (own,)

    def cast(directions: Array) -> tuple[Integers, Array, Array]:
        found = world.raycast(pose[:3, 3], pose[:3, 3] + RANGE * directions, ignore, sensor=sensor)
        return found.rows, RANGE * found.fraction, np.abs(np.einsum("mi,mi->m", found.normal, directions))

    def agrees(chosen: Integers, expected: tuple[Integers, Array, Array], near: Array, even: float) -> Bools:
        same = (rows[chosen] == expected[0]) & (np.abs(distance[chosen] - expected[1]) < near)
        result: Bools = same & ((np.abs(facing[chosen] - expected[2]) < even) | (rows[chosen] == NOTHING))
        return result

    others = np.flatnonzero(~agrees(np.arange(len(rays)), cast(rays), np.full(len(rays), 1e-5), 1e-5))
    assert len(others) < 0.01 * len(rays)
    beside = np.zeros(len(others), dtype=bool)
    sideways = np.cross(rays[others], (0.0, 0.0, 1.0))
    angle = BESIDE * np.maximum(1.0, 1.0 / distance[others])
    for turn in np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False):
        off = math.cos(turn) * sideways + math.sin(turn) * np.cross(sideways, rays[others])
        deflected = rays[others] + angle[:, None] * off
        deflected /= np.linalg.norm(deflected, axis=1)[:, None]
        # A deflected ray meets a surface at grazing incidence elsewhere
        near = 2.0 * angle * distance[others] / np.maximum(facing[others], 0.02)
        beside |= agrees(others, cast(deflected), near, 2.0 * float(angle.max(initial=0.0)))
    assert beside.all(), (rows[others[~beside]], distance[others[~beside]])
    return set(rows.tolist())


PROFILES = {
    "level": "",
    "slope": elevation_xml(slope=0.05),
    "hill": elevation_xml(slope=0.08) + superelevation_xml(-0.06),
}


@pytest.mark.usefixtures("bodies_are_boxes")
@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("seed", range(3))
def test_hits_equal_ray_casts_of_pybullet(profile: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    network = roads(rng, PROFILES[profile])
    with World(network) as world:
        world.add(MAST, Placement(100.0, 9.0))
        for number in range(12):
            pose = network.lane_pose_at("1", -1, rng.uniform(2.0, 198.0))
            tilt = rng.uniform(-0.3, 0.3, 2) if number % 3 == 2 else (pose.p, pose.r)
            side = rng.uniform(-3.0, 6.0)
            world.add(
                make_car(f"Car {number}"),
                Placement(pose.x, pose.y + side, pose.z, pose.h + rng.uniform(-0.5, 0.5), *tilt),
            )
        hit = {own: compare(world, own) for own in ("Car 0", "Car 2", "Mast")}
    assert all(-1 in rows and NOTHING in rows and max(rows) > 0 for rows in hit.values())


@pytest.mark.usefixtures("bodies_are_boxes")
@pytest.mark.parametrize("mount", [Mount(x=0.0, y=0.0, z=30.0, pitch=25.0), Mount(x=4.0, y=1.0, z=0.3, yaw=70.0)])
def test_hits_from_tilted_and_low_mounts_equal_ray_casts(mount: Mount) -> None:
    with World() as world:
        world.add(make_car("A"), Placement(0.0, 0.0, yaw=0.4))
        world.add(make_car("B"), Placement(14.0, 3.0, yaw=2.0))
        world.add_building("Hall", (25.0, 0.0, 5.0), (8.0, 40.0, 10.0), 0.3)
        world.add_building("Tower", (-30.0, 30.0, 20.0), (10.0, 10.0, 40.0))
        assert compare(world, "A", mount=mount, field_of_view=250.0, upper_fov=60.0, lower_fov=-90.0) >= {-1, 0}


@pytest.mark.usefixtures("bodies_are_boxes")
def test_actors_hidden_from_the_sensor_are_not_hit() -> None:
    with World() as world:
        for number in range(4):
            world.add(make_car(f"Car {number}"), Placement(10.0 * number, 2.0 * number))
        world.set_display_state({}, {"Car 1": Appearance(visibility=Visibility(named={"roof": False}))})
        assert compare(world, "Car 0", "roof") == {-2, -1, 0, 2}
        assert compare(world, "Car 0", "other") >= {1, 2}


def by_formula(triangles: Array, directions: Array, reach: float) -> tuple[Array, Array]:
    """Return distance (M,) and cosine (M,) of the first hits of rays from the origin, by Möller and Trumbore (Fast,
    minimum storage ray/triangle intersection, 1997)."""
    distance, cosine = np.full(len(directions), reach), np.zeros(len(directions))
    for a, b, c in triangles:
        e1, e2 = b - a, c - a
        across = np.cross(directions, e2)
        determinant = across @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            u = across @ -a / determinant
            v = directions @ np.cross(-a, e1) / determinant
            t = e2 @ np.cross(-a, e1) / determinant
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0) & (t < distance)
        normal = np.cross(e1, e2)
        distance = np.where(hit, t, distance)
        cosine = np.where(hit, np.abs(directions @ normal) / np.linalg.norm(normal), cosine)
    return distance, cosine


@pytest.mark.parametrize("seed", range(4))
def test_kernel_equals_formula_for_random_triangles(seed: int) -> None:
    """Also with rings in any order, straight up and down, and with triangles above, below and around the sensor."""
    rng = np.random.default_rng(seed)
    columns: int = 60
    elevations: Array = np.radians(rng.permutation(np.linspace(-90.0, 90.0, 37)))
    azimuths = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)
    triangles = rng.normal(0.0, 12.0, (80, 1, 3)) + rng.normal(0.0, 1.0, (80, 3, 3)) * rng.uniform(
        0.1, 12.0, (80, 1, 1)
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_matrix(*rng.uniform(-3.0, 3.0, 3)), rng.normal(0.0, 3.0, 3)
    turn, shift = rotation_matrix(*rng.uniform(-3.0, 3.0, 3)), rng.normal(0.0, 3.0, 3)
    hits = FanHits(RayFan(azimuths, elevations), np.arange(columns), pose, 20.0)
    hits.meet(Surfaces.group(triangles, 7), 5, turn, shift)
    flat, up = np.cos(elevations), np.sin(elevations)
    rays = np.stack(
        np.broadcast_arrays(flat * np.cos(azimuths)[:, None], flat * np.sin(azimuths)[:, None], up), axis=-1
    )
    local = (triangles @ turn.T + shift - pose[:3, 3]) @ pose[:3, :3]
    distance, cosine = by_formula(local, rays.reshape(-1, 3), 20.0)
    np.testing.assert_allclose(hits.distance.ravel(), distance, rtol=1e-9)
    np.testing.assert_allclose(hits.brightness.ravel(), cosine, atol=1e-9)
    assert 0.3 < (hits.rows == 5).mean() < 1.0
    assert np.array_equal(hits.rows.ravel() == NOTHING, distance == 20.0)


def test_no_ray_passes_between_the_triangles_of_a_closed_surface() -> None:
    rng = np.random.default_rng(2)
    columns: int = 720
    elevations: Array = np.radians(np.linspace(-90.0, 90.0, 181))
    box = Surfaces.of_boxes(np.array([(0.0, 0.0, -3.0, 9.0, 5.0, 6.0, 0.0)]))
    for shift in (np.zeros(3), rng.uniform(-2.0, 2.0, 3)):
        hits = FanHits(
            RayFan(np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False), elevations),
            np.arange(columns),
            np.eye(4),
            50.0,
        )
        hits.meet(box, 0, np.eye(3), shift)
        assert (hits.rows == 0).all()
