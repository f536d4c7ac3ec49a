"""One run: settings, building, tick, result."""

from eidrive_scenario.openscenario.loading import load_for_seed
from eidrive_scenario.simulation.run import (
    ABORTED,
    DEFAULT_SEED,
    FAILED,
    INVALID_INPUT,
    PASSED,
    Observer,
    RunResult,
    RunSettings,
)
from eidrive_scenario.simulation.simulation import Simulation, run_file

__all__ = [
    "ABORTED",
    "DEFAULT_SEED",
    "FAILED",
    "INVALID_INPUT",
    "PASSED",
    "Observer",
    "RunResult",
    "RunSettings",
    "Simulation",
    "load_for_seed",
    "run_file",
]
