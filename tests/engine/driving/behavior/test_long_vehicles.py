"""Turns of a bus through traffic."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.api.run import RunSettings, Simulation, load_scenario
from eidrive_scenario.extensions.library import library_path

pytestmark = pytest.mark.exhaustive


def test_bus_does_not_stop_in_the_way_of_a_car_that_appears(tmp_path: Path) -> None:
    """A truck hides an oncoming car until the front of the bus, 12 m long, is on the lane of the car."""
    text = (library_path() / "ei/scenario_02.xosc").read_text()
    start = text.index('<ScenarioObject name="Ego">')
    text = text[:start] + text[start:].replace('entryName="nissan_patrol"', 'entryName="bus"', 1)
    path = tmp_path / "bus.xosc"
    path.write_text(
        text.replace('path="../', f'path="{library_path()}/').replace('filepath="../', f'filepath="{library_path()}/')
    )
    with Simulation(load_scenario(path), seed=1, settings=RunSettings(planner="behavior")) as simulation:
        assert simulation.world.spec("Ego").category == "bus"
        result = simulation.run()
    assert [verdict.reason for verdict in result.criteria if not verdict.passed] == []
