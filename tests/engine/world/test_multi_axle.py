"""Tests of vehicles with more than two axles: specification, mesh, and turning by the slip of each axle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from eidrive_behaviors.actions.following import largest_curvature

from eidrive_scenario.openscenario import model
from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control, ExtraAxle, Placement
from eidrive_scenario.world.physics.dynamics import MultiAxleTrack, track_of, turning_wheelbase
from eidrive_scenario.world.physics.vehicle_parameters import GRAVITY, VehicleParameters
from eidrive_scenario.world.specs import actor_spec

STEP = 0.005
TRUCK = ActorSpec(
    "Truck", "truck", "truck", (9.0, 2.5, 3.5), (2.6, 0.0, 1.75),
    wheelbase=4.8, max_steering=0.7, wheel_radius=0.5, mass=18_000.0, max_speed=25.0, max_acceleration=2.0,
    max_deceleration=6.0, properties={"drag_area": "0", "rolling_resistance": "0", "steering_rate": "10"},
)  # fmt: skip


def with_axles(*extra: ExtraAxle) -> ActorSpec:
    return replace(TRUCK, extra_axles=extra)


def at(x: float, steering: float = 0.0) -> ExtraAxle:
    return ExtraAxle(x, 1.9, 0.5, steering)


def steady_curvature(spec: ActorSpec, speed: float, steering: float) -> float:
    """Return yaw rate over speed [1/m] of the steady turn at constant speed."""
    track = track_of(VehicleParameters.of(spec), STEP)
    demand = track.demand(Control(steering=steering), 1.0, 0.0)
    left = rate = 0.0
    for _ in range(4000):
        _, left, rate = track.advance(speed, left, rate, demand)
    assert track.advance(speed, left, rate, demand)[2] == pytest.approx(rate, rel=1e-9)
    return rate / speed


def equivalent_wheelbase(spec: ActorSpec, steering: float = 0.005) -> float:
    """Return steering angle over curvature at standstill, extrapolated linearly in the square of the speed."""
    slow, fast = 6.0, 9.0
    one, two = (math.tan(steering) / steady_curvature(spec, speed, steering) for speed in (slow, fast))
    return one - (two - one) * slow**2 / (fast**2 - slow**2)


def xml(category: str, front: bool, *additional: float, steering: float = 0.1) -> model.Vehicle:
    axle: dict[str, Any] = {"position_z": 0.5, "track_width": 1.9, "wheel_diameter": 1.0}
    return model.Vehicle(
        name="semi", vehicle_category=model.VehicleCategory(category), mass=18_000.0,
        bounding_box=model.BoundingBox(
            center=model.Center(x=2.6, y=0.0, z=1.75), dimensions=model.Dimensions(length=9.0, width=2.5, height=3.5)
        ),
        performance=model.Performance(max_speed=25.0, max_acceleration=2.0, max_deceleration=6.0),
        axles=model.Axles(
            front_axle=model.Axle(max_steering=0.7, position_x=4.8, **axle) if front else None,
            rear_axle=model.Axle(max_steering=0.0, position_x=0.0, **axle),
            additional_axle=tuple(model.Axle(max_steering=steering, position_x=x, **axle) for x in additional),
        ),
    )  # fmt: skip


def test_actor_spec_has_additional_axles() -> None:
    spec = actor_spec("Truck", xml("truck", True, -1.4, 3.4))
    assert spec.wheelbase == 4.8
    assert spec.extra_axles == (ExtraAxle(-1.4, 1.9, 0.5, 0.1), ExtraAxle(3.4, 1.9, 0.5, 0.1))
    trailer = actor_spec("Trailer", xml("semitrailer", False, -1.4, -2.8))
    assert [axle.x for axle in trailer.extra_axles] == [0.0, -1.4, -2.8]
    assert trailer.wheelbase == 0.0


def test_axles_of_a_group_share_load_and_stiffness() -> None:
    """The front axle has a share of 0.55, each of the two rear axles 0.45. Their mean is 0.7 m behind the rear axle."""
    p = VehicleParameters.of(with_axles(at(-1.4)))
    assert p.weight_front == pytest.approx(0.55 / 1.45)
    assert (p.wheelbase, p.rear) == pytest.approx((5.5, -0.7))
    assert p.cornering_stiffness_rear == pytest.approx(18.0 * 18_000 * GRAVITY * 0.9 / 1.45)
    track = track_of(p, STEP)
    assert track.to_reference == pytest.approx(0.55 / 1.45 * 5.5 - 0.7)
    two = VehicleParameters.of(TRUCK)
    assert not two.axles
    assert not isinstance(track_of(two, STEP), MultiAxleTrack)


@pytest.mark.parametrize("spread", [1.4, 2.6])
def test_tandem_has_equivalent_wheelbase_of_winkler(spread: float) -> None:
    """Winkler 1998: L' = L (1 + T/L² (1 + C_rear / C_front)), where T is the mean square position in the tandem."""
    spec = with_axles(at(-spread))
    p = VehicleParameters.of(spec)
    tandem = (spread / 2) ** 2
    ratio = p.cornering_stiffness_rear / p.cornering_stiffness_front
    expected = p.wheelbase * (1.0 + tandem / p.wheelbase**2 * (1.0 + ratio))
    assert equivalent_wheelbase(spec) == pytest.approx(expected, rel=2e-3)
    assert equivalent_wheelbase(TRUCK) == pytest.approx(4.8, rel=2e-3)


def test_turning_wheelbase_of_a_vehicle() -> None:
    """Scripted vehicles use this wheelbase when they follow a trajectory with vehicle dynamics."""
    assert turning_wheelbase(xml("truck", True)) == 4.8
    assert turning_wheelbase(xml("truck", True, -1.4)) == pytest.approx(4.8)  # The maxSteering is 0.1.
    assert turning_wheelbase(xml("trailer", False, -1.4)) == 0.0
    fixed = xml("truck", True, -1.4, steering=0.0)
    assert turning_wheelbase(fixed) == pytest.approx(5.5 * (1.0 + 0.7**2 / 5.5**2 * (1.0 + 18 * 0.9 / (14 * 0.55))))
    assert largest_curvature(fixed) == pytest.approx(math.tan(0.7) / turning_wheelbase(fixed))
    assert largest_curvature(xml("truck", True)) == pytest.approx(math.tan(0.7) / 4.8)


def test_steered_additional_axle_rolls_about_the_common_point() -> None:
    """A steered axle at the rear turns in the opposite direction, one at the front in the same direction.

    The truck then turns like one with two axles.
    """
    for x in (-1.6, 3.2):
        assert equivalent_wheelbase(with_axles(at(x, steering=0.5))) == pytest.approx(4.8, rel=2e-3)
    # With a very small maximum angle the axle behaves like a fixed one.
    held, fixed = (equivalent_wheelbase(with_axles(at(-1.6, steering=angle)), 0.02) for angle in (1e-6, 0.0))
    assert held == pytest.approx(fixed, rel=5e-3)


def test_multi_axle_vehicle_stops_in_a_turn_and_stays() -> None:
    spec = with_axles(at(-1.4), at(-2.8), at(3.4, steering=0.5))
    with World(dt=0.05) as world:
        world.add(spec, Placement(0.0, 0.0, speed=8.0), driven=True)
        for _ in range(100):
            world.step({}, {"Truck": Control(brake=0.7, steering=0.3)})
        before = world.view()
        for _ in range(100):
            world.step({}, {"Truck": Control(brake=0.7, steering=0.3)})
        after = world.view()
    assert before.yaw[0] > 0.05
    assert abs(after.speed[0]) < 1e-9
    assert np.abs(after.position - before.position).max() < 1e-9
    assert after.yaw[0] == before.yaw[0]


def tires(spec: ActorSpec) -> set[tuple[float, float, float]]:
    """Return position, radius and outer face of each pair of wheels in the frame of the reference point."""
    parts = actor_mesh(spec)["tire"]
    points = parts[parts[..., 1].min(axis=1) > 0.0].reshape(-1, 3)
    order = np.sort(points[:, 0])
    cuts = np.flatnonzero(np.diff(order) > 0.25)
    found: set[tuple[float, float, float]] = set()
    for low, high in zip([order[0], *order[cuts + 1]], [*order[cuts], order[-1]], strict=True):
        wheel = points[(points[:, 0] >= low) & (points[:, 0] <= high)]
        place, radius, face = (low + high) / 2 + spec.offset[0], (high - low) / 2, wheel[:, 1].max()
        found.add((round(float(place), 2), round(float(radius), 2), round(float(face), 2)))
    return found


@pytest.mark.parametrize(
    ("shape", "side"),
    [("truck", (1.6 + 0.55) / 2), ("firetruck", (1.6 + 0.55) / 2), ("bus", 0.998 * 1.25), ("van", 0.965 * 1.25)],
)
def test_mesh_has_wheels_at_each_axle(shape: str, side: float) -> None:
    """Wheels are at their track widths, with twin tires, below the skirts of a bus or a van and visible in the skin."""
    small = ExtraAxle(-1.4, 1.6, 0.4)
    spec = replace(with_axles(small), shape=shape)
    two = tires(replace(TRUCK, shape=shape))
    assert len(two) == 2
    (added,) = tires(spec) - two
    assert added == pytest.approx((-1.4, 0.4, side), abs=0.006)


def test_trailer_mesh_has_its_axles_and_no_cab() -> None:
    spec = actor_spec("Trailer", xml("semitrailer", False, -1.3))
    assert {place for place, *_ in tires(spec)} == {0.0, -1.3}
    assert "glass" not in actor_mesh(spec)
    points = np.concatenate([part.reshape(-1, 3) for part in actor_mesh(spec).values()])
    assert np.ptp(points, axis=0) == pytest.approx([9.0, 2.5, 3.5], abs=0.06)
