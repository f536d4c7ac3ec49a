"""Outcomes of a scenario over two parameters: without cooperation, with it, and with latency.

The values are those of a parameter value distribution, such as `ncap/crossing_car_grid`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.openscenario import ConcreteRun, load_distribution
from eidrive_scenario.simulation import RunSettings, run_file

ARMS: Mapping[str, Mapping[str, str]] = {
    "no cooperation": {"Participants": "none"},
    "cooperation": {"Participants": "both"},
    "latency 0.1 s": {"Participants": "both", "Latency": "0.1"},
    "latency 0.3 s": {"Participants": "both", "Latency": "0.3"},
    "latency 0.5 s": {"Participants": "both", "Latency": "0.5"},
}
"""Parameters of the runs of each arm."""


@dataclass(frozen=True)
class GridCell:
    """Outcome of one run: whether it passed, and the relative speed at its first collision [m/s] or None."""

    x: float
    y: float
    passed: bool
    impact_speed: float | None


@dataclass(frozen=True)
class OutcomeGrid:
    """Outcomes over the parameters `x_name` and `y_name`; cells of an arm are in the order of the distribution."""

    name: str
    x_name: str
    y_name: str
    arms: Mapping[str, tuple[GridCell, ...]]

    def collisions(self, arm: str) -> int:
        """Return the number of runs with a collision."""
        return sum(cell.impact_speed is not None for cell in self.arms[arm])


def run_outcome_grid(
    distribution: Path,
    *,
    arms: Mapping[str, Mapping[str, str]] = ARMS,
    parameters: Mapping[str, str] | None = None,
    seed: int = 1,
    workers: int | None = None,
    console: Console | None = None,
) -> OutcomeGrid:
    """Run all values of a distribution over two parameters in all arms.

    arms        parameters by arm, with precedence over `parameters` of all runs
    Raise SettingError if the distribution does not vary exactly two parameters, or a value is not a number.
    """
    runs = tuple(load_distribution(distribution, seed=seed))
    x_name, y_name = _axes(distribution, runs)
    jobs = [
        Job(str(run.scenario), arm, seed, RunSettings(parameters={**(parameters or {}), **values, **run.parameters}))
        for arm, values in arms.items()
        for run in runs
    ]
    outcomes = run_jobs(jobs, _outcome, workers=workers, console=console, title=distribution.stem)
    cells = [
        GridCell(_number(distribution, run, x_name), _number(distribution, run, y_name), *outcome)
        for run, outcome in zip(runs * len(arms), outcomes, strict=True)
    ]
    by_arm = {arm: tuple(cells[n * len(runs) : (n + 1) * len(runs)]) for n, arm in enumerate(arms)}
    return OutcomeGrid(distribution.stem, x_name, y_name, by_arm)


def _outcome(job: Job) -> tuple[bool, float | None]:
    result = run_file(job.scenario, seed=job.seed, settings=job.settings)
    speed = result.metrics.get("collision.impact_speed")
    return result.passed, None if speed is None else float(speed)


def _axes(distribution: Path, runs: tuple[ConcreteRun, ...]) -> tuple[str, str]:
    names = tuple(runs[0].parameters)
    if len(names) != 2:
        message = f"the distribution varies {len(names)} parameters (expected 2, the axes of the grid)"
        raise SettingError(Diagnostic(message, "use a distribution over two parameters", str(distribution)))
    for run in runs:
        for name in names:
            _number(distribution, run, name)
    return names[0], names[1]


def _number(distribution: Path, run: ConcreteRun, name: str) -> float:
    assignment = run.assignments[name]
    try:
        return float(assignment.text)
    except ValueError:
        message = f"parameter {quoted(name)}: not a number (got {quoted(assignment.text)})"
        hint = "use a distribution over numbers"
        raise SettingError(
            Diagnostic(message, hint, str(distribution), assignment.origin.line if assignment.origin else None)
        ) from None
