"""Tasks for test_repetitions; a module of its own, as worker processes import it by name."""

from __future__ import annotations

import os

from eidrive_scenario.experiments.repetitions import Job
from eidrive_scenario.randomness import generator


def draw(job: Job) -> tuple[str, int, float]:
    """Stands for a run: random, but only through its seed."""
    return job.arm, job.seed, float(generator(job.seed, job.arm).random())


def die(job: Job) -> None:
    """The process is gone, as after a crash of the physics."""
    os._exit(7)


def fail(job: Job) -> None:
    """Raises."""
    raise ValueError(f"seed {job.seed} is wrong")
