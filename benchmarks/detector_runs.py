"""Processor time of scenario 1 with each detector on ego and roadside unit.

Only names that older versions have as well are imported, so that their commits can be measured.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from eidrive_scenario.extensions.library import library_path, resolve_scenario
from eidrive_scenario.simulation import Simulation, load_for_seed

SCENARIO = "coop/scenario_1"
DEFAULT: Mapping[str, str] = {}
AS_EI_DRIVE = {"sensors": "{camera: {width: 800, height: 600, rate: 20}, lidar: {rate: 20}}"}
"""Image of CARLA's default size and a lidar reading in each tick."""
INT8 = {"detector_settings": "{precision: int8}"}


class RunTime(NamedTuple):
    """Simulated time and processor time [s] of one run, and whether it passed."""

    simulated: float
    total: float
    passed: bool


def run(detector: str, properties: Mapping[str, str], seed: int) -> RunTime:
    """Run the scenario once; `properties` are added to those of the controllers of the stations."""
    with _scenario({"detector": detector, **properties}) as path:
        simulation = Simulation(load_for_seed(path, seed, {}), seed=seed)
        start = time.process_time()
        result = simulation.run()
        times = time.process_time() - start
    return RunTime(result.simulated_s, times, result.passed)


@contextmanager
def _scenario(properties: Mapping[str, str]) -> Iterator[Path]:
    """Yield the path of a copy of the scenario with these properties."""
    path = resolve_scenario(SCENARIO)
    text = path.read_text(encoding="utf-8").replace('"../', f'"{library_path()}/')
    oracle = '<Property name="detector" value="oracle"/>'
    added = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties.items())
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(text.replace(oracle, added), encoding="utf-8")
        yield copy
