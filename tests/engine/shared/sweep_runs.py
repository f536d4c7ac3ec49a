"""Runs of stores in tests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun

VERSIONS = {"eidrive-scenario": "1.0", "numpy": "2.4"}
RUN = StoredRun(
    key="a" * 64,
    number=3,
    scenario="coop/scenario_1",
    run=None,
    seed=2,
    status="passed",
    point={"Speed": 8.5, "detector": "oracle"},
    result={"passed": True, "collision.count": 0.0, "collision.limit": None},
    error="",
    command="eidrive run coop/scenario_1 --seed 2",
    wall_s=0.25,
    settings='{"dt":0.05,"name":"ä"}',
)


@contextmanager
def opened(path: Path, **versions: str) -> Iterator[ResultStore]:
    with ResultStore.open(path, {**VERSIONS, **versions}) as store:
        yield store
