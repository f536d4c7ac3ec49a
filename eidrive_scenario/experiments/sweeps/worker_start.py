"""Start of worker processes as copies of a process that has imported what runs need."""

from __future__ import annotations

import multiprocessing
from multiprocessing.context import BaseContext

FORKSERVER = "forkserver"
_PRELOADED = ("eidrive_scenario.cli", "eidrive_scenario.experiments.sweeps.execution")
"""Modules that the server imports. It has no physics client and executes no run."""


def worker_context() -> BaseContext:
    """Return the context of worker processes: a server forks them, or each imports all if the system has no server."""
    if FORKSERVER not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context(FORKSERVER)
    context.set_forkserver_preload([*_PRELOADED])
    return context


def start_server() -> None:
    """Start the server of worker processes, which imports while this process prepares the jobs."""
    if worker_context().get_start_method() == FORKSERVER:
        from multiprocessing import forkserver

        forkserver.ensure_running()
