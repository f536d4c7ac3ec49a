"""Runs from Python: load, simulate, observe, and read the result.

Stable: all names.
"""

from eidrive_scenario.base.wall_limit import limit_wall_time as limit_wall_time
from eidrive_scenario.checks.rule import CheckReport as CheckReport
from eidrive_scenario.checks.scenario_checks import check_scenario as check_scenario
from eidrive_scenario.driving.step import StationAction as StationAction
from eidrive_scenario.errors import ABORTED as ABORTED
from eidrive_scenario.errors import FAILED as FAILED
from eidrive_scenario.errors import INVALID_INPUT as INVALID_INPUT
from eidrive_scenario.errors import NOT_JUDGED as NOT_JUDGED
from eidrive_scenario.errors import PASSED as PASSED
from eidrive_scenario.experiments.judgement import Judgement as Judgement
from eidrive_scenario.experiments.judgement import judge_recording as judge_recording
from eidrive_scenario.experiments.single_run import run_and_save as run_and_save
from eidrive_scenario.experiments.statistics.sequential import success_rate as success_rate
from eidrive_scenario.experiments.success_rate import RateVerdict as RateVerdict
from eidrive_scenario.experiments.sweeps.results import read_results as read_results
from eidrive_scenario.export.tool_topics import add_topics as add_topics
from eidrive_scenario.openscenario import ConcreteRun as ConcreteRun
from eidrive_scenario.openscenario import DistributionExpansion as DistributionExpansion
from eidrive_scenario.openscenario import load_distribution as load_distribution
from eidrive_scenario.openscenario import load_scenario as load_scenario
from eidrive_scenario.openscenario.model import Controller as Controller
from eidrive_scenario.openscenario.values.parameters import Assignment as Assignment
from eidrive_scenario.openscenario.variation import variations as variations
from eidrive_scenario.recording.frame import Frame as Frame
from eidrive_scenario.recording.recording import Recording as Recording
from eidrive_scenario.recording.recording import read_recording as read_recording
from eidrive_scenario.recording.text.csv_writer import text_of_csv as text_of_csv
from eidrive_scenario.rendering import picture_maker as picture_maker
from eidrive_scenario.rendering.tone_mapping import ideal_image as ideal_image
from eidrive_scenario.simulation import Observer as Observer
from eidrive_scenario.simulation import RunResult as RunResult
from eidrive_scenario.simulation import RunSettings as RunSettings
from eidrive_scenario.simulation import Simulation as Simulation
from eidrive_scenario.simulation import load_for_seed as load_for_seed
from eidrive_scenario.simulation import run_file as run_file
from eidrive_scenario.simulation.tick import TickStart as TickStart
from eidrive_scenario.world import World as World
from eidrive_scenario.world.camera import Pinhole as Pinhole
from eidrive_scenario.world.road_objects import buildings as buildings
from eidrive_scenario.world.specs import actor_spec as actor_spec
from eidrive_scenario.world.weather import Weather as Weather
from eidrive_scenario.world.weather import load_weather as load_weather
