"""Fixtures of rendering: a car and a level world with pictures."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sample_car import CarFactory, make_car

from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.world import World


@pytest.fixture
def car() -> CarFactory:
    """Factory of cars."""
    return make_car


@pytest.fixture
def world() -> Iterator[World]:
    """Level world at 20 ticks per second with pictures."""
    with World(dt=0.05, picture_maker=picture_maker) as world:
        yield world
