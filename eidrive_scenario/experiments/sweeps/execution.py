"""Execution of one job of a sweep in a worker process."""

from __future__ import annotations

import os
import signal
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from eidrive_scenario import exit_codes
from eidrive_scenario.errors import ConstraintError, InputError, OutputError, WallLimitError
from eidrive_scenario.experiments.commands import command_of_source
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, source_of
from eidrive_scenario.experiments.sweeps.store import (
    ABORTED,
    CRASHED,
    EXCLUDED,
    FAILED,
    FOLDER,
    INVALID,
    NOT_JUDGED,
    PASSED,
    StoredRun,
)
from eidrive_scenario.library import name_of
from eidrive_scenario.openscenario import ConcreteRun
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.simulation.result_views import typed
from eidrive_scenario.wall_limit import running_line

_is_worker = False
"""Whether this process only executes runs, so that no user interrupts it."""


def prepare_process() -> None:
    """Prepare a worker process: equal images are processed once, and an interruption ends the command, not the run."""
    global _is_worker
    image_memory.activate(image_memory.ImageMemory())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _is_worker = True


@dataclass(frozen=True)
class KeptFiles:
    """Files of the runs of a sweep.

    below   folder of a subfolder per run, with `result.json` and, by `record`, its recording
    record  `always`, `on-failure` or `never`
    store   file of the store; rows name folders relative to its folder
    """

    below: Path
    record: str
    store: Path


def execute(job: SweepJob, wall_limit: float | None, files: KeptFiles | None = None) -> StoredRun:
    """Run a job and return its row; errors are rows, too, also interruptions that an extension raises in a worker.

    wall_limit  limit of the wall time of loading and run [s]
    files       files that are kept; None for none
    """
    start = time.perf_counter()
    try:
        result = run_and_save(
            source_of(job),
            seed=job.seed,
            settings=job.settings,
            below=None if files is None else files.below,
            record=False if files is None else files.record,
            wall_limit=wall_limit,
        )
        unjudged = result.exit_code == exit_codes.NOT_JUDGED
        return StoredRun(
            key=job.key,
            number=job.number,
            scenario=result.scenario,
            run=job.run,
            seed=job.seed,
            status=PASSED if result.passed else NOT_JUDGED if unjudged else FAILED,
            point=dict(job.point),
            result={**result.to_dict(), **_folder(result.folder, files)},
            error=result.warnings[0] if unjudged else "",
            command=result.command,
            wall_s=round(time.perf_counter() - start, 4),
            settings=result.settings.canonical,
        )
    except ConstraintError as error:
        return _without_result(job, EXCLUDED, str(error), time.perf_counter() - start)
    except OutputError as error:  # not of the inputs, so that --retry repeats the run
        return _without_result(job, ABORTED, str(error), time.perf_counter() - start)
    except InputError as error:
        return _without_result(job, INVALID, str(error), time.perf_counter() - start)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and not _is_worker:
            raise
        return _without_result(job, ABORTED, _message(error), time.perf_counter() - start)


def _folder(folder: Path | None, files: KeptFiles | None) -> dict[str, str]:
    """Return the column of the folder of a run, if its files are kept."""
    if folder is None or files is None:
        return {}
    return {FOLDER: os.path.relpath(folder.resolve(), files.store.resolve().parent)}


def crashed(job: SweepJob, message: str) -> StoredRun:
    """Return the row of a job whose worker process ended."""
    return _without_result(job, CRASHED, message, 0.0)


def hung(job: SweepJob, message: str, wall_limit: float | None) -> StoredRun:
    """Return the row of a job whose code did not return at the limit of its wall time [s]."""
    return _without_result(job, ABORTED, message, wall_limit or 0.0)


def _without_result(job: SweepJob, status: str, message: str, wall_s: float) -> StoredRun:
    source: Path | ConcreteRun = job.scenario
    with suppress(InputError):  # of a distribution that has changed since the plan
        source = source_of(job)
    is_known = job.run is None or isinstance(source, ConcreteRun)
    varied = source.parameters if isinstance(source, ConcreteRun) else {}
    return StoredRun(
        key=job.key,
        number=job.number,
        scenario=name_of(source.scenario if isinstance(source, ConcreteRun) else source),
        run=job.run,
        seed=job.seed,
        status=status,
        point=dict(job.point),
        result={f"parameter.{name}": typed(text) for name, text in varied.items()},
        error=message,
        command=command_of_source(source, job.seed, job.settings) if is_known else "",
        wall_s=round(wall_s, 4),
    )


def _message(error: BaseException) -> str:
    """Return the error of a run; with its traceback if it is none of a run."""
    if isinstance(error, KeyboardInterrupt):
        return f"{running_line(error.__traceback__)}: KeyboardInterrupt (an extension cannot interrupt a sweep)"
    if isinstance(error, WallLimitError) or type(error).__module__.startswith("eidrive_scenario"):
        return str(error)
    return "".join(traceback.format_exception(error)).rstrip()
