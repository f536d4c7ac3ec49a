"""Runs from Python: load, simulate, observe, and read the result.

Stable: all names.
"""

from eidrive_scenario.base.wall_limit import limit_wall_time
from eidrive_scenario.checks.rule import CheckReport
from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.driving.step import StationAction
from eidrive_scenario.errors import ABORTED, FAILED, INVALID_INPUT, NOT_JUDGED, PASSED
from eidrive_scenario.experiments.judgement import Judgement, judge_recording
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.experiments.statistics.sequential import success_rate
from eidrive_scenario.experiments.success_rate import RateVerdict
from eidrive_scenario.experiments.sweeps.results import read_results
from eidrive_scenario.export.tool_topics import add_topics
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution, load_scenario
from eidrive_scenario.openscenario.model import Controller
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.openscenario.variation import variations
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import Recording, read_recording
from eidrive_scenario.recording.text.csv_writer import text_of_csv
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.rendering.tone_mapping import ideal_image
from eidrive_scenario.simulation import Observer, RunResult, RunSettings, Simulation, load_for_seed, run_file
from eidrive_scenario.simulation.tick import TickStart
from eidrive_scenario.world import World
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.road_objects import buildings
from eidrive_scenario.world.specs import actor_spec
from eidrive_scenario.world.weather import Weather, load_weather

__all__ = [
    "ABORTED",
    "FAILED",
    "INVALID_INPUT",
    "NOT_JUDGED",
    "PASSED",
    "Assignment",
    "CheckReport",
    "ConcreteRun",
    "Controller",
    "DistributionExpansion",
    "Frame",
    "Judgement",
    "Observer",
    "Pinhole",
    "RateVerdict",
    "Recording",
    "RunResult",
    "RunSettings",
    "Simulation",
    "StationAction",
    "TickStart",
    "Weather",
    "World",
    "actor_spec",
    "add_topics",
    "buildings",
    "check_scenario",
    "ideal_image",
    "judge_recording",
    "limit_wall_time",
    "load_distribution",
    "load_for_seed",
    "load_scenario",
    "load_weather",
    "picture_maker",
    "read_recording",
    "read_results",
    "run_and_save",
    "run_file",
    "success_rate",
    "text_of_csv",
    "variations",
]
