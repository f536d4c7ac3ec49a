"""How fast scenario 1 runs with the oracle on one core, against a bare pybullet loop, and where the time goes.

The bare loop has the same bodies in the same places, and makes the same physics steps and ray casts in the same order;
what it lacks is everything else. Both are measured alternately in this process, after a warm-up; medians are printed.

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

from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world.bullet import bullet
from eidrive_scenario.world.view import WorldView

SCENARIO = "coop/scenario_1"
PACKAGE = "eidrive_scenario"

Function = tuple[str, int, str]


@dataclass
class Trace:
    """What a run asked of pybullet, tick by tick: the views, and the steps and ray casts that led to the next one."""

    views: list[WorldView] = field(default_factory=list)
    calls: list[list[tuple[Any, Any] | None]] = field(default_factory=lambda: [[]])

    def observe(self, frame: Frame) -> None:
        """The observer's half: a view ends a tick of calls."""
        self.views.append(frame.view)
        self.calls.append([])

    def close(self) -> None:
        """Nothing to release."""

    @property
    def steps(self) -> int:
        """Physics steps of the whole run."""
        return sum(call is None for tick in self.calls for call in tick)

    @property
    def rays(self) -> int:
        """Rays of the whole run."""
        return sum(len(call[0]) for tick in self.calls for call in tick if call is not None)


@contextmanager
def listening(trace: Trace) -> Iterator[None]:
    """Note each physics step (None) and each batch of rays (origins, targets) while the run goes on."""
    step, cast = bullet.stepSimulation, bullet.rayTestBatch

    def noted_step(*given: Any, **options: Any) -> Any:
        trace.calls[-1].append(None)
        return step(*given, **options)

    def noted_cast(origins: Any, targets: Any, *given: Any, **options: Any) -> Any:
        trace.calls[-1].append((origins.copy(), targets.copy()))
        return cast(origins, targets, *given, **options)

    bullet.stepSimulation, bullet.rayTestBatch = noted_step, noted_cast
    try:
        yield
    finally:
        bullet.stepSimulation, bullet.rayTestBatch = step, cast


def bare_loop(trace: Trace, dt: float) -> float:
    """Seconds for the trace in pybullet alone."""
    client = bullet.connect(bullet.DIRECT)
    here = {"physicsClientId": client}
    bullet.createMultiBody(0.0, bullet.createCollisionShape(bullet.GEOM_PLANE, **here), **here)
    bullet.setPhysicsEngineParameter(fixedTimeStep=dt * len(trace.views) / max(trace.steps, 1), **here)
    handles: dict[str, int] = {}
    started = time.perf_counter()
    for view, calls in zip(trace.views, trace.calls, strict=False):
        boxes, speeds = view.boxes.tolist(), view.speed.tolist()
        for name, (x, y, z, length, width, height, yaw), speed in zip(view.names, boxes, speeds, strict=True):
            if name not in handles:
                half = (length / 2, width / 2, height / 2)
                shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, **here)
                handles[name] = bullet.createMultiBody(0.0, shape, useMaximalCoordinates=1, **here)
            elif not speed:
                continue
            turn = bullet.getQuaternionFromEuler((0.0, 0.0, yaw))
            bullet.resetBasePositionAndOrientation(handles[name], (x, y, z), turn, **here)
        for call in calls:
            if call is None:
                bullet.stepSimulation(**here)
            else:
                bullet.rayTestBatch(*call, numThreads=1, **here)
    seconds = time.perf_counter() - started
    bullet.disconnect(**here)
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
    bare_loop(trace, settings.dt)
    whole, loading, bare = [], [], []
    for _ in range(given.runs):
        loading.append(timed(lambda: build().close()))
        whole.append(build().run().wall_s)
        bare.append(bare_loop(trace, settings.dt))
    ratios = [ours / theirs for ours, theirs in zip(whole, bare, strict=True)]

    print(
        f"{SCENARIO}, oracle, channel {given.channel}, seed {given.seed}: {simulated:.2f} s in {len(trace.views)} ticks"
    )
    print(f"  {len(trace.views[-1].names)} actors, {trace.steps} physics steps, {trace.rays} rays; {given.runs} runs")
    print(f"  simulated s per wall s     {simulated / median(whole):8.1f}   (aim: at least 30)")
    print(f"  the same with loading      {simulated / (median(whole) + median(loading)):8.1f}")
    print(f"  per tick                   {1e3 * median(whole) / len(trace.views):8.3f} ms")
    print(f"  bare pybullet loop         {1e3 * median(bare) / len(trace.views):8.3f} ms per tick")
    print(f"  ratio to the bare loop     {median(ratios):8.2f}   (aim: below 3)")
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
