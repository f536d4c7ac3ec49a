"""How fast scenario 1 runs with the oracle on one core, against a bare pybullet loop, and where the time goes.

The bare loop has the same bodies: it repeats the run's calls to pybullet that move them, step the physics and cast the
rays, in the same order, and does nothing else. A second one also reads back poses, velocities and contacts as the run
does. All are measured alternately in this process, after a warm-up; medians are printed.

    python benchmarks/bench_scenario_1.py [--runs 7] [--seed 1] [--channel ideal]
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world.bullet import bullet

SCENARIO = "coop/scenario_1"
PACKAGE = "eidrive_scenario"

Function = tuple[str, int, str]
Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]

SETUP = frozenset({"setPhysicsEngineParameter", "createCollisionShape", "createMultiBody", "changeDynamics",
                   "setCollisionFilterGroupMask", "removeBody"})  # fmt: skip
LOOP = frozenset({"resetBasePositionAndOrientation", "resetBaseVelocity", "stepSimulation",
                  "performCollisionDetection", "rayTestBatch"})  # fmt: skip
READING = frozenset({"getBasePositionAndOrientation", "getBaseVelocity", "getContactPoints"})


@dataclass
class Trace:
    """What a run asked of pybullet: (function, arguments, options), those of the set-up and those of each tick."""

    setup: list[Call] = field(default_factory=list)
    ticks: list[list[Call]] = field(default_factory=list)
    actors: int = 0

    def note(self, function: Callable[..., Any], given: tuple[Any, ...], options: dict[str, Any]) -> None:
        """One call; arrays are copied, and the client is left out."""
        calls = self.ticks[-1] if self.ticks else self.setup
        kept = tuple(value.copy() if isinstance(value, np.ndarray) else value for value in given)
        calls.append((function, kept, {key: value for key, value in options.items() if key != "physicsClientId"}))

    def observe(self, frame: Frame) -> None:
        """The observer's half: what follows belongs to the next tick."""
        self.ticks.append([])
        self.actors = len(frame.view.names)

    def close(self) -> None:
        """Nothing to release."""

    def count(self, name: str, of: Callable[[Call], int] = lambda call: 1) -> int:
        """How many calls of that function the run made, or the sum of `of` over them."""
        return sum(of(call) for calls in self.ticks for call in calls if call[0].__name__ == name)


@contextmanager
def listening(trace: Trace) -> Iterator[None]:
    """Note each call to one of the functions of SETUP, LOOP and READING while the run goes on."""

    def noted(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **options: Any) -> Any:
            trace.note(function, given, options)
            return function(*given, **options)

        return call

    originals = {name: getattr(bullet, name) for name in SETUP | LOOP | READING}
    for name, function in originals.items():
        setattr(bullet, name, noted(function))
    try:
        yield
    finally:
        for name, function in originals.items():
            setattr(bullet, name, function)


def bare_loop(trace: Trace, kinds: frozenset[str]) -> float:
    """Seconds for the calls of these kinds in the ticks of the trace, in pybullet alone."""
    chosen = [[call for call in calls if call[0].__name__ in kinds | SETUP] for calls in trace.ticks]
    client = bullet.connect(bullet.DIRECT)
    for function, given, options in trace.setup:
        function(*given, **options, physicsClientId=client)
    started = time.perf_counter()
    for calls in chosen:
        for function, given, options in calls:
            function(*given, **options, physicsClientId=client)
    seconds = time.perf_counter() - started
    bullet.disconnect(physicsClientId=client)
    return seconds


def shares_by_room(profile: cProfile.Profile) -> dict[str, float]:
    """The share of the time in each room; libraries count for the room that calls them, pybullet for itself."""
    stats: dict[Function, Any] = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    owners: dict[Function, dict[str, float]] = {}

    def owners_of(function: Function, above: frozenset[Function]) -> dict[str, float]:
        room = _room(function)
        if room:
            return {room: 1.0}
        if function in owners:
            return owners[function]
        callers = {caller: entry[2] for caller, entry in stats[function][4].items() if caller not in above}
        total = sum(callers.values())
        found: dict[str, float] = defaultdict(float)
        for caller, own in callers.items():
            weight = own / total if total else 1.0 / len(callers)
            for name, share in owners_of(caller, above | {function}).items():
                found[name] += weight * share
        if not above:
            owners[function] = dict(found)
        return dict(found) or {"python": 1.0}

    seconds: dict[str, float] = defaultdict(float)
    for function, (_, _, own, _, _) in stats.items():
        for room, share in owners_of(function, frozenset()).items():
            seconds[room] += own * share
    total = sum(seconds.values())
    return {room: own / total for room, own in sorted(seconds.items(), key=lambda entry: -entry[1])}


def _room(function: Function) -> str:
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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--channel", default="ideal")
    given = parser.parse_args()
    path = resolve_scenario(SCENARIO)
    settings = RunSettings(channel=given.channel, detector="oracle")

    def build(*observers: Any) -> Simulation:
        scenario = load_for_seed(path, given.seed, settings.parameters)
        return Simulation(scenario, seed=given.seed, settings=settings, observers=observers)

    trace = Trace()
    with listening(trace):
        simulated = build(trace).run().simulated_s
    bare_loop(trace, LOOP | READING)
    whole, loading, bare, reading = [], [], [], []
    for _ in range(given.runs):
        loading.append(timed(lambda: build().close()))
        whole.append(build().run().wall_s)
        bare.append(bare_loop(trace, LOOP))
        reading.append(bare_loop(trace, LOOP | READING))
    steps, rays = trace.count("stepSimulation"), trace.count("rayTestBatch", lambda call: len(call[1][0]))
    ratio, reading_ratio = (
        median(ours / theirs for ours, theirs in zip(whole, alone, strict=True)) for alone in (bare, reading)
    )

    print(
        f"{SCENARIO}, oracle, channel {given.channel}, seed {given.seed}: {simulated:.2f} s in {len(trace.ticks)} ticks"
    )
    print(f"  {trace.actors} actors, {steps} physics steps, {rays} rays; {given.runs} runs")
    print(f"  simulated s per wall s     {simulated / median(whole):8.1f}   (aim: at least 30)")
    print(f"  the same with loading      {simulated / (median(whole) + median(loading)):8.1f}")
    print(f"  per tick                   {1e3 * median(whole) / len(trace.ticks):8.3f} ms")
    print(f"  bare pybullet loop         {1e3 * median(bare) / len(trace.ticks):8.3f} ms per tick, ratio {ratio:.2f}")
    print(
        f"  the same, reading back     {1e3 * median(reading) / len(trace.ticks):8.3f} ms per tick, "
        f"ratio {reading_ratio:.2f}   (aim: below 3)"
    )
    profile = cProfile.Profile()
    simulation = build()
    profile.enable()
    simulation.run()
    profile.disable()
    print("where the time of a run goes (cProfile; libraries count for the room that calls them):")
    for room, share in shares_by_room(profile).items():
        if share >= 0.005:
            print(f"  {room:24} {100 * share:5.1f} %  {'#' * round(50 * share)}")


def timed(task: Callable[[], object]) -> float:
    """Seconds that a task takes."""
    started = time.perf_counter()
    task()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
