"""Studies of many runs: jobs, statistics, average precision, and the scenarios of the library.

Stable: all names but those of jobs and average precision, which may change in a minor version.
"""

from eidrive_scenario.base.content_digest import canonical_json as canonical_json
from eidrive_scenario.base.content_digest import sha256_of as sha256_of
from eidrive_scenario.experiments.average_precision import area_in_order as area_in_order
from eidrive_scenario.experiments.average_precision import average_precision as average_precision
from eidrive_scenario.experiments.average_precision import match_by_share as match_by_share
from eidrive_scenario.experiments.average_precision import matching_order as matching_order
from eidrive_scenario.experiments.commands import command_of as command_of
from eidrive_scenario.experiments.repetitions import Job as Job
from eidrive_scenario.experiments.repetitions import cores as cores
from eidrive_scenario.experiments.repetitions import jobs_of as jobs_of
from eidrive_scenario.experiments.repetitions import run_jobs as run_jobs
from eidrive_scenario.experiments.single_run import as_json_text as as_json_text
from eidrive_scenario.experiments.statistics.intervals import Proportion as Proportion
from eidrive_scenario.experiments.statistics.intervals import Summary as Summary
from eidrive_scenario.experiments.statistics.intervals import interval_text as interval_text
from eidrive_scenario.experiments.statistics.intervals import jackknife_interval as jackknife_interval
from eidrive_scenario.experiments.statistics.intervals import mean_interval as mean_interval
from eidrive_scenario.experiments.statistics.intervals import summarize as summarize
from eidrive_scenario.experiments.statistics.intervals import wilson as wilson
from eidrive_scenario.experiments.statistics.paired import PairedDifference as PairedDifference
from eidrive_scenario.experiments.statistics.paired import PairedVerdicts as PairedVerdicts
from eidrive_scenario.experiments.statistics.paired import paired_difference as paired_difference
from eidrive_scenario.experiments.statistics.paired import paired_ratio as paired_ratio
from eidrive_scenario.experiments.statistics.paired import paired_spread as paired_spread
from eidrive_scenario.extensions.library import LibraryScenario as LibraryScenario
from eidrive_scenario.extensions.library import definition as definition
from eidrive_scenario.extensions.library import describe_scenarios as describe_scenarios
from eidrive_scenario.extensions.library import from_library as from_library
from eidrive_scenario.extensions.library import library_path as library_path
from eidrive_scenario.extensions.library import resolve_scenario as resolve_scenario
