"""Bodies of actors as lidars see them: extent, closed skins, windows, postures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.sensing.bodies import body_surfaces
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.ray_fan import FanHits, RayFan
from eidrive_scenario.sensing.settings import LidarSettings, Mount
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.appearance import AnimationState, Appearance
from eidrive_scenario.world.surfaces import Surfaces
from eidrive_scenario.world.view import NOTHING

SIZES = {
    "car": (4.892, 1.837, 1.490), "firetruck": (8.468, 2.891, 3.827), "ambulance": (6.366, 2.351, 2.431),
    "bus": (12.135, 2.55, 3.12), "van": (5.93, 2.02, 2.62), "truck": (8.3, 2.5, 3.55), "motorbike": (2.2, 0.8, 1.6),
    "bicycle": (1.8, 0.65, 1.75), "pedestrian": (0.5, 0.5, 1.86), "box": (1.0, 2.0, 0.5),
}  # fmt: skip


def spec_of(shape: str) -> ActorSpec:
    length, _, height = SIZES[shape]
    wheelbase = 0.0 if shape in ("pedestrian", "box") else 0.6 * length
    offset = (wheelbase / 2.0, 0.0, height / 2.0)
    return ActorSpec("A", shape, shape, SIZES[shape], offset, wheelbase=wheelbase, wheel_radius=0.33)


def hits_from(surfaces: Surfaces, x: float, y: float, z: float) -> FanHits:
    """Return the hits of a dense fan of rays from a point on surfaces at the origin."""
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    columns: int = 1440
    fan = RayFan(np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False), np.radians(np.linspace(-60.0, 20.0, 161)))
    hits = FanHits(fan, np.arange(columns), pose, 60.0)
    hits.meet(surfaces, 0, np.eye(3), np.zeros(3))
    return hits


@pytest.mark.parametrize("shape", SIZES)
def test_body_fills_the_bounding_box(shape: str) -> None:
    """Mirrors and the arms of a pedestrian may be outside it by a tenth of a meter."""
    spec = spec_of(shape)
    corners = body_surfaces(spec, "").triangles.reshape(-1, 3) - spec.offset
    for end in (corners.max(axis=0), -corners.min(axis=0)):
        assert (end > np.array(spec.size) / 2.0 - 0.1).all()
        assert (end < np.array(spec.size) / 2.0 + 0.1).all()


@pytest.mark.parametrize("shape", SIZES)
def test_first_hits_from_outside_are_on_front_faces(shape: str) -> None:
    """Faces that point away are left out: except beside edges, these hits are those on both sides of all faces."""
    body = body_surfaces(spec_of(shape), "")
    assert body.closed
    both = Surfaces(body.triangles, body.first, body.spheres, body.reflectivity)
    for x, y, z in ((-9.0, 3.0, 1.9), (5.0, 7.0, 5.0)):
        front, all_faces = hits_from(body, x, y, z), hits_from(both, x, y, z)
        assert (front.rows == 0).sum() > 50
        differ = np.abs(front.distance - all_faces.distance) > 1e-9
        assert differ.sum() < 0.01 * (front.rows == 0).sum()


def test_windows_of_a_car_return_nothing_and_its_body_does() -> None:
    """From behind and above: glass is hit, but no point is measured there; roof, trunk and tires are measured."""
    with World() as world:
        car = spec_of("car")
        world.add(ActorSpec("Mast", "rsu", "misc", (0.3, 0.3, 4.0), (0.0, 0.0, 2.0)), Placement(-9.0, 0.0))
        world.add(car, Placement(0.0, 0.0))
        view = world.view()
        settings = LidarSettings(
            channels=128, points_per_second=128 * 1440 * 20, mount=Mount(x=0.0, y=0.0, z=3.0), range_noise=0.0
        )
        lidar = Lidar(settings, world.spec("Mast"))
        hits = hits_from(body_surfaces(car, ""), -9.0, 0.0, 3.0)
        cloud = lidar.read(world, view, 0)
    glass = (hits.rows == 0) & (hits.brightness == 0.0)
    assert 0.1 < glass.sum() / (hits.rows == 0).sum() < 0.4
    points = cloud.world_points
    on_car = points[(np.abs(points[:, :2] - (car.offset[0], 0.0)) < (2.5, 0.95)).all(axis=1) & (points[:, 2] > 0.05)]
    # The rear window is between the trunk at 0.65 and the roof at 0.98 of the height, 1.3 m wide.
    height, middle = on_car[:, 2] / 1.49, np.abs(on_car[:, 1]) < 0.5
    assert np.count_nonzero(middle & (height > 0.70) & (height < 0.90)) == 0
    assert np.count_nonzero(middle & (height > 0.95)) > 20
    assert np.count_nonzero(middle & (height < 0.65)) > 20


def test_pedestrian_has_the_posture_of_its_motion() -> None:
    walker = spec_of("pedestrian")
    with World() as world:
        world.add(walker, Placement(0.0, 0.0))
        assert world.motion("A") == ""
        world.set_display_state({}, {"A": Appearance(animations={"motion": AnimationState("motion", "lying")})})
        assert world.motion("A") == "lying"
    standing, lying = (hits_from(body_surfaces(walker, motion), -5.0, 0.0, 1.0) for motion in ("", "lying"))
    rising = np.radians(np.linspace(-60.0, 20.0, 161))
    highest = [1.0 + (hits.distance * np.sin(rising))[hits.rows != NOTHING].max() for hits in (standing, lying)]
    assert highest[0] > 1.8
    assert highest[1] < 0.7
