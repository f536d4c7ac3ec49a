"""Tasks of worker processes in the tests of sweeps."""

from __future__ import annotations

import os
import signal

from eidrive_scenario.experiments.sweeps.execution import KeptFiles, execute
from eidrive_scenario.experiments.sweeps.jobs import SweepJob
from eidrive_scenario.experiments.sweeps.store import StoredRun


def killed_at_30(job: SweepJob, wall_limit: float | None, files: KeptFiles | None) -> StoredRun:
    """Execute a job; the process of the one with the speed 30 is killed."""
    if job.point["Speed"] == 30:
        os.kill(os.getpid(), signal.SIGKILL)
    return execute(job, wall_limit, files)
