"""Studies of many runs: jobs, statistics, average precision, and the scenarios of the library.

Stable: all names but those of jobs and average precision, which may change in a minor version.
"""

from eidrive_scenario.base.content_digest import canonical_json, sha256_of
from eidrive_scenario.experiments.average_precision import (
    area_in_order,
    average_precision,
    match_by_share,
    matching_order,
)
from eidrive_scenario.experiments.repetitions import Job, cores, jobs_of, run_jobs
from eidrive_scenario.experiments.single_run import as_json_text
from eidrive_scenario.experiments.statistics.intervals import (
    Proportion,
    Summary,
    interval_text,
    jackknife_interval,
    mean_interval,
    summarize,
    wilson,
)
from eidrive_scenario.experiments.statistics.paired import (
    PairedDifference,
    PairedVerdicts,
    paired_difference,
    paired_ratio,
    paired_spread,
)
from eidrive_scenario.extensions.library import (
    LibraryScenario,
    definition,
    describe_scenarios,
    from_library,
    library_path,
    resolve_scenario,
)

__all__ = [
    "Job",
    "LibraryScenario",
    "PairedDifference",
    "PairedVerdicts",
    "Proportion",
    "Summary",
    "area_in_order",
    "as_json_text",
    "average_precision",
    "canonical_json",
    "cores",
    "definition",
    "describe_scenarios",
    "from_library",
    "interval_text",
    "jackknife_interval",
    "jobs_of",
    "library_path",
    "match_by_share",
    "matching_order",
    "mean_interval",
    "paired_difference",
    "paired_ratio",
    "paired_spread",
    "resolve_scenario",
    "run_jobs",
    "sha256_of",
    "summarize",
    "wilson",
]
