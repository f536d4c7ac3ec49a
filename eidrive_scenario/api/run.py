"""Runs from Python: load, simulate, observe, and read the result.

Stable: all names.
"""

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import (
    ABORTED,
    FAILED,
    INVALID_INPUT,
    PASSED,
    Observer,
    RunResult,
    RunSettings,
    Simulation,
    load_for_seed,
    run_file,
)

__all__ = [
    "ABORTED",
    "FAILED",
    "INVALID_INPUT",
    "PASSED",
    "Frame",
    "Observer",
    "RunResult",
    "RunSettings",
    "Simulation",
    "load_for_seed",
    "run_file",
]
