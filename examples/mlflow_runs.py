"""Runs of a scenario with several channels as runs of MLflow: settings, speed over time, metrics and verdicts.

MLflow writes to a local store unless MLFLOW_TRACKING_URI names a server, so that no network is needed:
`pip install mlflow`, `python mlflow_runs.py`, `mlflow ui`.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import mlflow

from eidrive_scenario.api.run import Frame, RunResult, RunSettings, run_file


class MlflowObserver:
    """Observer that logs a run to MLflow."""

    def __init__(self, actor: str = "Ego") -> None:
        self.actor = actor

    def begin(self, simulation: Any) -> None:
        mlflow.start_run()

    def observe(self, frame: Frame) -> None:
        row = frame.view.rows.get(self.actor)
        if row is not None:
            mlflow.log_metric("speed", float(frame.view.speed[row]), step=round(1000.0 * frame.view.time))

    def conclude(self, result: RunResult) -> None:
        mlflow.log_params({key: value for key, value in result.to_dict().items() if isinstance(value, str)})
        mlflow.log_metrics({name: value for name, value in result.metrics.items() if math.isfinite(value)})
        mlflow.set_tags({verdict.name: verdict.reason for verdict in result.criteria} | {"command": result.command})
        mlflow.end_run("FINISHED" if result.passed else "FAILED")

    def close(self) -> None:
        mlflow.end_run("KILLED")  # without effect after `conclude`


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="coop/scenario_1")
    parser.add_argument("--channel", nargs="+", default=["ideal", "latency_300ms"])
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    for channel in given.channel:
        for seed in range(1, given.seeds + 1):
            settings = RunSettings(channel=channel)
            result = run_file(given.scenario, seed=seed, settings=settings, observers=[MlflowObserver()])
            print(channel, seed, "passed" if result.passed else "failed")


if __name__ == "__main__":
    main()
