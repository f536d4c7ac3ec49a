"""How fast scenario 1 runs with the oracle on one core, against bare pybullet, and where the time goes.

The bare loop is what a program in pybullet alone would do with the same bodies, steps and rays. In each tick it puts
those scripted bodies that move to where they were in the run; makes all physics steps, in each of which it reads pose
and velocity of every driven body, sets the velocity (that of the run) and asks for its contacts; reads pose and
velocity of every body; and casts the rays of the run. It has no vehicle model, no storyboard, no stations, no messages,
no criteria. Its bodies are made by the same calls as in the run.

The run itself asks less of pybullet, as a driven body that nothing can touch does not need it. How long those calls
alone take is printed too.

All runs do the same, tick by tick, and whatever else goes on in the machine only adds to the time of a tick. So of
each tick the least time counts that it took in any of the runs, which are made in turn; for all three alike.

    python benchmarks/bench_scenario_1.py [--runs 15] [--seed 1] [--channel ideal]
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world.physics.bodies import quaternion
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.view import ActorState

SCENARIO = "coop/scenario_1"
PACKAGE = "eidrive_scenario"
PHYSICS_RATE = 200.0
"""That of the run [Hz]."""

Function = tuple[str, int, str]
Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]

SETUP = frozenset({"setPhysicsEngineParameter", "createCollisionShape", "createVisualShape", "createMultiBody",
                   "changeDynamics", "setCollisionFilterGroupMask", "removeBody"})  # fmt: skip
LOOP = frozenset({"resetBasePositionAndOrientation", "resetBaseVelocity", "stepSimulation", "performCollisionDetection",
                  "rayTestBatch", "getBasePositionAndOrientation", "getBaseVelocity", "getContactPoints"})  # fmt: skip


@dataclass
class Trace:
    """What a run asked of pybullet, and where its actors were: an observer of the run.

    setup  calls that make bodies;  ticks  the other calls of each tick;  states  of the actors in each tick, by name
    """

    setup: list[Call] = field(default_factory=list)
    ticks: list[list[Call]] = field(default_factory=lambda: [[]])
    states: list[dict[str, ActorState]] = field(default_factory=list)
    handles: dict[str, int] = field(default_factory=dict)
    driven: frozenset[str] = frozenset()

    def note(self, function: Callable[..., Any], given: tuple[Any, ...], options: dict[str, Any]) -> None:
        """One call; arrays and lists are copied."""
        calls = self.setup if function.__name__ in SETUP else self.ticks[-1]
        kept = tuple(value.copy() if isinstance(value, np.ndarray) else value for value in given)
        calls.append((function, kept, {key: deepcopy(value) for key, value in options.items()}))

    def observe(self, frame: Frame) -> None:
        """The observer's half: what follows belongs to the next tick."""
        self.ticks.append([])
        self.states.append(dict(zip(frame.view.names, frame.view.states, strict=True)))

    def close(self) -> None:
        """Nothing to release."""

    def calls(self, name: str) -> list[list[Call]]:
        """The calls of one function, tick by tick."""
        return [[call for call in calls if call[0].__name__ == name] for calls in self.ticks]


@contextmanager
def listening(trace: Trace) -> Iterator[None]:
    """Note each call to one of the functions of SETUP and LOOP while the run goes on."""

    def noted(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **options: Any) -> Any:
            trace.note(function, given, options)
            return function(*given, **options)

        return call

    originals = {name: getattr(bullet, name) for name in SETUP | LOOP}
    for name, function in originals.items():
        setattr(bullet, name, noted(function))
    try:
        yield
    finally:
        for name, function in originals.items():
            setattr(bullet, name, function)


def timed_run(simulation: Simulation) -> list[float]:
    """Seconds of each tick of a run."""
    times: list[float] = []
    end = None
    with simulation:
        while end is None:
            started = time.perf_counter()
            _, end = simulation.tick()
            times.append(time.perf_counter() - started)
    return times


def repeated_calls(trace: Trace) -> list[float]:
    """Seconds that the run's own calls to pybullet take, tick by tick."""
    times: list[float] = []
    with fresh_client(trace):
        for calls in trace.ticks:
            started = time.perf_counter()
            for function, given, options in calls:
                function(*given, **options)
            times.append(time.perf_counter() - started)
    return times


def bare_loop(trace: Trace, dt: float) -> list[float]:
    """Seconds for the same bodies, steps and rays in pybullet alone, tick by tick."""
    here = {"physicsClientId": CLIENT}
    steps = round(dt * PHYSICS_RATE)
    rays = [[given for _, given, _ in calls] for calls in trace.calls("rayTestBatch")]
    driven = [trace.handles[name] for name in trace.driven]
    plan = [
        _tick_of_bare_loop(trace, before, after) for before, after in zip(trace.states, trace.states[1:], strict=False)
    ]
    times: list[float] = []
    with fresh_client(trace):
        for (moved, velocities), cast in zip(plan, rays, strict=False):
            started = time.perf_counter()
            for origins, targets in cast:
                bullet.rayTestBatch(origins, targets, numThreads=1, **here)
            for handle, at, turn, velocity, rate in moved:
                bullet.resetBasePositionAndOrientation(handle, at, turn, **here)
                bullet.resetBaseVelocity(handle, velocity, rate, **here)
            for _ in range(steps):
                for handle, (velocity, rate) in zip(driven, velocities, strict=True):
                    bullet.getBasePositionAndOrientation(handle, **here)
                    bullet.getBaseVelocity(handle, **here)
                    bullet.resetBaseVelocity(handle, velocity, rate, **here)
                bullet.stepSimulation(**here)
                for handle in driven:
                    bullet.getContactPoints(handle, **here)
            for handle in trace.handles.values():
                bullet.getBasePositionAndOrientation(handle, **here)
                bullet.getBaseVelocity(handle, **here)
            bullet.performCollisionDetection(**here)
            times.append(time.perf_counter() - started)
    return times


def _tick_of_bare_loop(
    trace: Trace, before: dict[str, ActorState], after: dict[str, ActorState]
) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Where scripted bodies go that move, and the velocities of driven ones."""
    moved = [
        (trace.handles[name], now[:3], quaternion(*now[3:6]), now[6:9], (0.0, 0.0, now.yaw_rate))
        for name, now in after.items()
        if name not in trace.driven and now != before.get(name)
    ]
    return moved, [(after[name][6:9], (0.0, 0.0, after[name].yaw_rate)) for name in trace.driven]


@contextmanager
def fresh_client(trace: Trace) -> Iterator[None]:
    """A client with the bodies of the run, which has the number that the run's client had."""
    if bullet.connect(bullet.DIRECT) != CLIENT:
        raise RuntimeError("another client of pybullet is open")
    try:
        for function, given, options in trace.setup:
            function(*given, **options)
        yield
    finally:
        bullet.disconnect(physicsClientId=CLIENT)


CLIENT = 0
"""The number that pybullet gives to its first client."""


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
    parser.add_argument("--runs", type=int, default=15)
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
        simulation = build(trace)
        bodies, trace.driven = simulation.world._bodies, simulation.stations.drivers
        trace.handles = {name: body.handle for name, body in bodies.items()}
        simulated = simulation.run().simulated_s
    bare_loop(trace, settings.dt)
    whole, loading, bare, repeated = [], [], [], []
    for _ in range(given.runs):
        loading.append(timed(lambda: build().close()))
        whole.append(timed_run(build()))
        bare.append(bare_loop(trace, settings.dt))
        repeated.append(repeated_calls(trace))
    ticks, ours, alone, own_calls = len(trace.states), least(whole), least(bare), least(repeated)
    steps = (ticks - 1) * round(settings.dt * PHYSICS_RATE)
    rays = sum(len(call[1][0]) for calls in trace.calls("rayTestBatch") for call in calls)

    print(f"{SCENARIO}, oracle, channel {given.channel}, seed {given.seed}: {simulated:.2f} s in {ticks} ticks")
    print(f"  {len(trace.handles)} actors, {steps} physics steps, {rays} rays; {given.runs} runs")
    print(f"  simulated s per wall s     {simulated / ours:8.1f}   (aim: at least 30)")
    print(f"  the same with loading      {simulated / (ours + min(loading)):8.1f}")
    print(f"  per tick                   {1e3 * ours / ticks:8.3f} ms")
    print(f"  bare pybullet loop         {1e3 * alone / ticks:8.3f} ms per tick")
    print(f"  ratio to the bare loop     {ours / alone:8.2f}   (aim: below 3)")
    print(f"  the run's own calls        {1e3 * own_calls / ticks:8.3f} ms per tick")
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


def least(runs: list[list[float]]) -> float:
    """The sum of the least times of all ticks [s]."""
    return sum(map(min, zip(*runs, strict=True)))


if __name__ == "__main__":
    main()
