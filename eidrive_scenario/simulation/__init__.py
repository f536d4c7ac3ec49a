"""One run: settings, building, tick, result."""

from eidrive_scenario.openscenario.loading import load_for_seed
from eidrive_scenario.simulation.run import DEFAULT_SEED, Observer, RunResult, RunSettings
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
