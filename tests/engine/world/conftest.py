"""Fixtures of the world: a car and a level world."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sample_car import CarFactory

from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec


@pytest.fixture
def car() -> CarFactory:
    """Factory of cars of 1500 kg with a wheelbase of 2.7 m and a box of 4.5 x 1.8 x 1.5 m around x = 1.35."""

    def make(name: str = "Ego", *, shape: str = "car", **properties: object) -> ActorSpec:
        return ActorSpec(
            name=name,
            shape=shape,
            category="car",
            size=(4.5, 1.8, 1.5),
            offset=(1.35, 0.0, 0.75),
            wheelbase=2.7,
            max_steering=0.6,
            wheel_radius=0.32,
            mass=1500.0,
            max_speed=50.0,
            max_acceleration=4.0,
            max_deceleration=8.0,
            properties={key: str(value) for key, value in properties.items()},
        )

    return make


@pytest.fixture
def world() -> Iterator[World]:
    """Level world at 20 ticks per second."""
    with World(dt=0.05) as world:
        yield world
