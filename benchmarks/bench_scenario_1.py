"""Speed of scenario 1 with the oracle on one core, compared with bare pybullet, and time by package.

The bare loop is a pybullet program with the same bodies, steps and rays. In each tick it does the following:

- place the scripted bodies that moved in the run at their positions;
- make all physics steps: read pose and velocity of every driven body, set its velocity to that of the run, and query
  its contacts;
- read pose and velocity of every body;
- cast the rays of the run.

It has no vehicle model, storyboard, stations, messages or criteria. Its bodies and rays are those of the run without
the shortcuts of the world: one body for each building, and all rays between a sensor and an object.

The run itself makes fewer pybullet calls: a driven body that cannot touch anything does not need pybullet, and an
object with free space before it no rays. The time of these calls alone is printed too.

All runs are equal, tick by tick, and other load of the machine only adds to the time of a tick. So the minimum time of
each tick over all runs counts. The three variants are run in turn.

    python benchmarks/bench_scenario_1.py [--runs 15] [--seed 1] [--channel ideal]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from timing import profiled, sum_of_minima, tick_times

from eidrive_scenario.base.geometry import quaternion
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world import World
from eidrive_scenario.world.physics.bullet import bullet, connect, disconnect
from eidrive_scenario.world.view import ActorState

SCENARIO = "coop/scenario_1"
PHYSICS_RATE = 200.0
"""Physics rate of the run [Hz]."""

Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]

SETUP = frozenset({"setPhysicsEngineParameter", "createCollisionShape", "createCollisionShapeArray",
                   "createVisualShape", "createMultiBody", "changeDynamics", "setCollisionFilterGroupMask",
                   "removeBody"})  # fmt: skip
LOOP = frozenset({"resetBasePositionAndOrientation", "resetBaseVelocity", "stepSimulation", "performCollisionDetection",
                  "rayTestBatch", "getBasePositionAndOrientation", "getBaseVelocity", "getContactPoints"})  # fmt: skip


@dataclass
class Trace:
    """Observer that records the pybullet calls of a run and the states of its actors.

    setup  calls that create bodies;  ticks  other calls of each tick;  states  of the actors in each tick, by name
    """

    setup: list[Call] = field(default_factory=list)
    ticks: list[list[Call]] = field(default_factory=lambda: [[]])
    states: list[dict[str, ActorState]] = field(default_factory=list)
    handles: dict[str, int] = field(default_factory=dict)
    driven: frozenset[str] = frozenset()

    def record(self, function: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> None:
        """Record one call; arrays and lists are copied."""
        calls = self.setup if function.__name__ in SETUP else self.ticks[-1]
        kept = tuple(value.copy() if isinstance(value, np.ndarray) else value for value in arguments)
        calls.append((function, kept, {key: deepcopy(value) for key, value in options.items()}))

    def observe(self, frame: Frame) -> None:
        """Store the states; later calls belong to the next tick."""
        self.ticks.append([])
        self.states.append(dict(zip(frame.view.names, frame.view.states, strict=True)))

    def close(self) -> None:
        """Do nothing."""

    def calls(self, name: str) -> list[list[Call]]:
        """Return the calls of one function, tick by tick."""
        return [[call for call in calls if call[0].__name__ == name] for calls in self.ticks]


@contextmanager
def record_calls(trace: Trace) -> Iterator[None]:
    """Record each call of the functions in SETUP and LOOP during the run."""

    def recorded(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            trace.record(function, arguments, options)
            return function(*arguments, **options)

        return call

    originals = {name: getattr(bullet, name) for name in SETUP | LOOP}
    for name, function in originals.items():
        setattr(bullet, name, recorded(function))
    try:
        yield
    finally:
        for name, function in originals.items():
            setattr(bullet, name, function)


@contextmanager
def without_shortcuts() -> Iterator[None]:
    """Give each building a separate body, and cast all rays of sensors."""
    from eidrive_scenario.world.physics import scenery

    if not hasattr(scenery, "MAX_BOXES"):  # An older commit, measured by `compare.py`
        yield
        return

    is_free, most = World.is_free, scenery.MAX_BOXES
    World.is_free = lambda world, own, origin, target: False  # type: ignore[assignment, method-assign]
    scenery.MAX_BOXES = 1
    try:
        yield
    finally:
        World.is_free, scenery.MAX_BOXES = is_free, most  # type: ignore[method-assign]


def repeated_calls(trace: Trace) -> list[float]:
    """Return the time of the pybullet calls of the run [s], tick by tick."""
    times: list[float] = []
    with fresh_client(trace) as client:
        for calls in [at_client(calls, client) for calls in trace.ticks]:
            started = time.perf_counter()
            for function, arguments, options in calls:
                function(*arguments, **options)
            times.append(time.perf_counter() - started)
    return times


def bare_loop(trace: Trace, dt: float) -> list[float]:
    """Return the time of the same bodies, steps and rays in bare pybullet [s], tick by tick."""
    steps = round(dt * PHYSICS_RATE)
    rays = [[arguments for _, arguments, _ in calls] for calls in trace.calls("rayTestBatch")]
    driven = [trace.handles[name] for name in trace.driven]
    plan = [
        _tick_of_bare_loop(trace, previous, current)
        for previous, current in zip(trace.states, trace.states[1:], strict=False)
    ]
    times: list[float] = []
    with fresh_client(trace) as client:
        here = {"physicsClientId": client}
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
    trace: Trace, previous: dict[str, ActorState], current: dict[str, ActorState]
) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Return the new states of moving scripted bodies, and the velocities of driven ones."""
    moved = [
        (trace.handles[name], now[:3], quaternion(*now[3:6]), now[6:9], (0.0, 0.0, now.yaw_rate))
        for name, now in current.items()
        if name not in trace.driven and now != previous.get(name)
    ]
    return moved, [(current[name][6:9], (0.0, 0.0, current[name].yaw_rate)) for name in trace.driven]


@contextmanager
def fresh_client(trace: Trace) -> Iterator[int]:
    """Yield a client with the bodies of the run."""
    client = connect()
    try:
        for function, arguments, options in at_client(trace.setup, client):
            function(*arguments, **options)
        yield client
    finally:
        disconnect(client)


def at_client(calls: list[Call], client: int) -> list[Call]:
    """Return recorded calls for another client than that of the run, which is named, or the last argument."""
    return [
        (function, arguments, {**options, "physicsClientId": client})
        if "physicsClientId" in options
        else (function, (*arguments[:-1], client), options)
        for function, arguments, options in calls
    ]


@dataclass(frozen=True)
class Measured:
    """Times of a run and of the bare loop.

    trace       of the bare loop
    simulated   simulated time [s]
    loading     times of loading [s]
    run_time, bare_time, calls_time   of the run, of the bare loop and of the pybullet calls of the run [s]
    """

    simulated: float
    loading: list[float]
    run_time: float
    bare_time: float
    calls_time: float
    trace: Trace
    dt: float


def build(seed: int, channel: str, *observers: Any) -> Simulation:
    """Return the run that is measured."""
    settings = RunSettings(channel=channel, detector="oracle")
    scenario = load_for_seed(resolve_scenario(SCENARIO), seed, settings.parameters)
    return Simulation(scenario, seed=seed, settings=settings, observers=observers)


def traced(seed: int, channel: str) -> tuple[Trace, float, float]:
    """Return the pybullet calls of a run, its simulated time, and the duration of a tick [s]."""
    trace = Trace()
    with record_calls(trace):
        simulation = build(seed, channel, trace)
        bodies, trace.driven = simulation.world._bodies, simulation.stack.drivers
        trace.handles = {name: body.handle for name, body in bodies.items()}
        return trace, simulation.run().simulated_s, simulation.settings.dt


def measure(runs: int, seed: int, channel: str) -> Measured:
    """Measure the run, the bare loop and the pybullet calls of the run in turn."""
    with without_shortcuts():
        trace, simulated, dt = traced(seed, channel)
    own_trace, _, _ = traced(seed, channel)
    bare_loop(trace, dt)
    complete, loading, bare, repeated = [], [], [], []
    for _ in range(runs):
        started = time.perf_counter()
        simulation = build(seed, channel)
        loading.append(time.perf_counter() - started)
        complete.append(tick_times(simulation, time.perf_counter))
        bare.append(bare_loop(trace, dt))
        repeated.append(repeated_calls(own_trace))
    run_time, bare_time, calls_time = (sum_of_minima(part) for part in (complete, bare, repeated))
    return Measured(simulated, loading, run_time, bare_time, calls_time, trace, dt)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--channel", default="ideal")
    arguments = parser.parse_args()
    measured = measure(arguments.runs, arguments.seed, arguments.channel)
    trace, run_time, bare_time = measured.trace, measured.run_time, measured.bare_time
    ticks = len(trace.states)
    steps = (ticks - 1) * round(measured.dt * PHYSICS_RATE)
    rays = sum(len(call[1][0]) for calls in trace.calls("rayTestBatch") for call in calls)

    run = f"{SCENARIO}, oracle, channel {arguments.channel}, seed {arguments.seed}"
    print(f"{run}: {measured.simulated:.2f} s in {ticks} ticks")
    print(f"  {len(trace.handles)} actors, {steps} physics steps, {rays} rays; {arguments.runs} runs")
    print(f"  simulated s per wall s     {measured.simulated / run_time:8.1f}   (aim: at least 30)")
    print(f"  including loading          {measured.simulated / (run_time + min(measured.loading)):8.1f}")
    print(f"  per tick                   {1e3 * run_time / ticks:8.3f} ms")
    print(f"  bare pybullet loop         {1e3 * bare_time / ticks:8.3f} ms per tick")
    print(f"  ratio to the bare loop     {run_time / bare_time:8.2f}   (aim: below 3)")
    print(f"  pybullet calls of the run  {1e3 * measured.calls_time / ticks:8.3f} ms per tick")
    profiled(build(arguments.seed, arguments.channel).run)


if __name__ == "__main__":
    main()
