"""Roads of the library for the traffic tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.roads import RoadNetwork


@pytest.fixture(scope="session")
def library_roads() -> RoadNetwork:
    """Crossing of scenario 2: a street of 2+2 lanes, a street of 1+1, and four lights."""
    return RoadNetwork.load(Path(__file__).parents[3] / "xosc" / "roads" / "coop_2.xodr")
