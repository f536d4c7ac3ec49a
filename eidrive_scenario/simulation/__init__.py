"""One run: settings, building, tick, result."""

from eidrive_scenario.openscenario.loading import load_for_seed as load_for_seed
from eidrive_scenario.run_options import DEFAULT_SEED as DEFAULT_SEED
from eidrive_scenario.run_options import RunSettings as RunSettings
from eidrive_scenario.simulation.observers import Observer as Observer
from eidrive_scenario.simulation.result import RunResult as RunResult
from eidrive_scenario.simulation.simulation import Simulation as Simulation
from eidrive_scenario.simulation.simulation import run_file as run_file
