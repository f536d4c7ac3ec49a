"""Times of runs: minima over repetitions, and shares of packages in a profile."""

from __future__ import annotations

import cProfile
import pstats
import time
from collections import defaultdict
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from eidrive_scenario.simulation import Simulation

PACKAGE = "eidrive_scenario"
Function = tuple[str, int, str]
_DEEPEST = 6
"""Maximum number of functions of libraries between a function and the package that it counts for."""


def tick_times(simulation: Simulation, clock: Callable[[], float]) -> list[float]:
    """Return the time of each tick of a run by a clock [s], and close the run."""
    times: list[float] = []
    end = None
    with simulation:
        while end is None:
            started = clock()
            _, end = simulation.tick()
            times.append(clock() - started)
    return times


def minimum_time(task: Callable[[], object], repeats: int) -> float:
    """Return the minimum processor time of a task [ms], which is done once before to fill caches."""
    task()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        task()
        times.append(time.process_time() - started)
    return 1e3 * min(times)


def sum_of_minima(runs: list[list[float]]) -> float:
    """Return the sum of the minimum times of all ticks [s]."""
    total: float = sum(map(min, zip(*runs, strict=True)))
    return total


def profiled(task: Callable[[], object]) -> cProfile.Profile:
    """Return the profile of a task, and print its shares of time by package, those of at least 0.5 %."""
    profile = cProfile.Profile()
    profile.runcall(task)
    print("time of a run by package (cProfile; libraries count for the package that calls them):")
    for package, share in shares_by_package(profile).items():
        if share >= 0.005:
            print(f"  {package:24} {100 * share:5.1f} %  {'#' * round(50 * share)}")
    return profile


def shares_by_package(profile: cProfile.Profile) -> dict[str, float]:
    """Return the share of time by package; libraries count for the package that calls them, pybullet separately."""
    stats: dict[Function, Any] = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    owners: dict[Function, dict[str, float]] = {}

    def owners_of(function: Function, above: frozenset[Function]) -> dict[str, float]:
        package = _package_of(function)
        if package:
            return {package: 1.0}
        if function in owners:
            return owners[function]
        if len(above) > _DEEPEST:
            return {"python": 1.0}
        callers = {caller: entry[2] for caller, entry in stats[function][4].items() if caller not in above}
        total = sum(callers.values())
        shares: dict[str, float] = defaultdict(float)
        for caller, own in callers.items():
            weight = own / total if total else 1.0 / len(callers)
            for name, share in owners_of(caller, above | {function}).items():
                shares[name] += weight * share
        if not above:
            owners[function] = dict(shares)
        return dict(shares) or {"python": 1.0}

    seconds: dict[str, float] = defaultdict(float)
    for function, (_, _, own, _, _) in stats.items():
        for package, share in owners_of(function, frozenset()).items():
            seconds[package] += own * share
    total = sum(seconds.values())
    return {package: own / total for package, own in sorted(seconds.items(), key=lambda entry: -entry[1])}


def _package_of(function: Function) -> str:
    file, _, name = function
    if file == "~" and "pybullet" in name:
        return "pybullet itself"
    for package in (PACKAGE, "eidrive_behaviors", "eidrive_criteria"):
        _, separator, inside = file.rpartition(f"/{package}/")
        if separator:
            folder, is_folder, _ = inside.partition("/")
            return package if package != PACKAGE else folder + is_folder
    return ""
