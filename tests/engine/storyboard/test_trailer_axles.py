"""Equivalent single axle of trailers with several axles."""

from __future__ import annotations

import math
from typing import Any

import pytest

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.storyboard.kinematics.trailers import Coupling, bar

REACH = 6.0


def vehicle(*axles: tuple[float, float], **parts: Any) -> model.Vehicle:
    """Return a vehicle with axles by position and maximum steering angle; the first is the rear axle."""
    rear, *extra = [
        model.Axle(max_steering=angle, position_x=x, position_z=0.5, track_width=2.0, wheel_diameter=1.0)
        for x, angle in axles
    ]
    return model.Vehicle(
        name="trailer",
        vehicle_category=model.VehicleCategory("semitrailer"),
        bounding_box=model.BoundingBox(
            center=model.Center(x=2.0, y=0.0, z=1.5), dimensions=model.Dimensions(length=10.0, width=2.5, height=3.0)
        ),
        performance=model.Performance(max_speed=25.0, max_acceleration=2.0, max_deceleration=6.0),
        axles=model.Axles(rear_axle=rear, additional_axle=tuple(extra)),
        **parts,
    )


def test_equivalent_axle_is_behind_the_middle_of_the_axles() -> None:
    assert bar(vehicle((0.0, 0.0)), REACH) == REACH
    assert bar(vehicle((0.0, 0.0), (-1.4, 0.0)), REACH) == pytest.approx((6.0**2 + 7.4**2) / 13.4)
    # The middle one of three, and the axles on both sides of it: 6 + 2/3 · 1.3² / 6.
    three = vehicle((0.0, 0.0), (1.3, 0.0), (-1.3, 0.0))
    assert bar(three, REACH) == pytest.approx(6.0 + 2.0 * 1.3**2 / 18.0)
    # An axle that steers follows the others.
    assert bar(vehicle((0.0, 0.0), (-1.4, 0.3)), REACH) == REACH


@pytest.mark.parametrize("axles", [((0.0, 0.0),), ((0.0, 0.0), (-1.4, 0.0), (-2.8, 0.0))])
def test_trailer_in_long_turn_follows_circle_of_its_equivalent_axle(axles: tuple[tuple[float, float], ...]) -> None:
    """The equivalent axle rolls without slip beside the center of the turn: at the distance √(R² - bar²)."""
    trailer = vehicle(*axles, trailer_coupler=model.TrailerCoupler(dx=REACH))
    truck = vehicle((0.0, 0.0), trailer_hitch=model.TrailerHitch(dx=0.0))
    front, back = Actor("Truck", truck, (), None), Actor("Trailer", trailer, (), None)
    coupling = Coupling.of(front, back)
    radius, step = 20.0, 0.0005
    back.motion.set_observed_state(Pose(20.0, -REACH, 0.0, math.pi / 2, 0.0, 0.0), 1.0)
    for count in range(round(2.5 * math.pi / step)):
        angle = count * step
        x, y = radius * math.cos(angle), radius * math.sin(angle)
        front.motion.set_observed_state(Pose(x, y, 0.0, angle + math.pi / 2, 0.0, 0.0), 1.0)
        back.motion.set_towed_state(coupling.next_pose(), front.motion)
    length = bar(trailer, REACH)
    pose = back.motion.pose
    at = front.motion.pose.x - length * math.cos(pose.h), front.motion.pose.y - length * math.sin(pose.h)
    assert math.hypot(*at) == pytest.approx(math.sqrt(radius**2 - length**2), rel=1e-3)
    assert math.hypot(pose.x - front.motion.pose.x, pose.y - front.motion.pose.y) == pytest.approx(REACH)
