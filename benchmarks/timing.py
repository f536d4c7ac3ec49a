"""Times of runs: minima over repetitions, and shares of packages in a profile."""

from __future__ import annotations

import cProfile
import pstats
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGE = "eidrive_scenario"
Function = tuple[str, int, str]
_DEEPEST = 6
"""Maximum number of functions of libraries between a function and the package that it counts for."""


def timed(task: Callable[[], object]) -> float:
    """Return the time of a task [s]."""
    started = time.perf_counter()
    task()
    return time.perf_counter() - started


def sum_of_minima(runs: list[list[float]]) -> float:
    """Return the sum of the minimum times of all ticks [s]."""
    total: float = sum(map(min, zip(*runs, strict=True)))
    return total


def print_shares(profile: cProfile.Profile) -> None:
    """Print the shares of time by package, those of at least 0.5 %."""
    print("time of a run by package (cProfile; libraries count for the package that calls them):")
    for package, share in shares_by_package(profile).items():
        if share >= 0.005:
            print(f"  {package:24} {100 * share:5.1f} %  {'#' * round(50 * share)}")


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
    parts = Path(file).parts
    for package in (PACKAGE, "eidrive_behaviors", "eidrive_criteria"):
        if package in parts:
            inside = parts[len(parts) - parts[::-1].index(package) :]
            return (
                f"{inside[0]}/"
                if package == PACKAGE and len(inside) > 1
                else inside[0]
                if package == PACKAGE
                else package
            )
    return ""
