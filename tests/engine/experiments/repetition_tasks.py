"""Tasks of test_repetitions in a separate module, which worker processes import by name."""

from __future__ import annotations

import os
import time
from pathlib import Path

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.repetitions import Job


def draw(job: Job) -> tuple[str, int, float]:
    """Return a random number that depends only on arm and seed."""
    return job.arm, job.seed, float(generator(job.seed, job.arm).random())


def die(job: Job) -> None:
    """End the process abnormally."""
    os._exit(7)


def fail(job: Job) -> None:
    """Raise ValueError."""
    raise ValueError(f"seed {job.seed} is invalid")


def fail_at_seed_3(job: Job) -> int:
    """Return the seed; raise ValueError for seed 3."""
    if job.seed == 3:
        fail(job)
    return job.seed


def sleep(job: Job) -> None:
    """Write the number of this process into the folder that the job names as its scenario, and sleep."""
    (Path(job.scenario) / f"{os.getpid()}.pid").touch()
    time.sleep(100.0)
