"""Fixtures of the world: a car and a level world."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sample_car import CarFactory, make_car

from eidrive_scenario.world import World


@pytest.fixture
def car() -> CarFactory:
    """Factory of cars."""
    return make_car


@pytest.fixture
def world() -> Iterator[World]:
    """Level world at 20 ticks per second."""
    with World(dt=0.05) as world:
        yield world
