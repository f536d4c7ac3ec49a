"""One run: settings, building, tick, result."""

from eidrive_scenario.openscenario.loading import load_for_seed
from eidrive_scenario.run_options import DEFAULT_SEED, RunSettings
from eidrive_scenario.simulation.observers import Observer
from eidrive_scenario.simulation.result import RunResult
from eidrive_scenario.simulation.simulation import Simulation, run_file

__all__ = [
    "DEFAULT_SEED",
    "Observer",
    "RunResult",
    "RunSettings",
    "Simulation",
    "load_for_seed",
    "run_file",
]
