"""Speed of the radio: 200 stations at 10 Hz on one channel, with generation, medium access and reception.

Cars are spaced by 20 m on each of two lanes of a 2 km road and drive at 25 m/s; a truck blocks every tenth line of
sight. All stations receive from all others, so each simulated second has 398,000 transmission outcomes. A tick contains
all radio work of a run: messages are delivered, generated and sent, and their outcomes enter the trace hash. Times are
processor times, summed over threads, and the minimum of several repetitions.

Then complete runs: 200 scripted cars of a generated scenario send CAM, at 10 Hz or by the ETSI generation rules. One of
them receives, or all do, each with separate fusion. Obstruction between antennas is random, or determined by 19,900
rays.

    python benchmarks/bench_radio.py [--stations 200] [--seconds 3] [--technology 80211p] [--repetitions 3]
"""

from __future__ import annotations

import argparse
import cProfile
import gc
import pstats
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from radio_scenes import write_scenario

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LOS, NLOSV, LineOfSightStates, RadioEnvironment
from eidrive_scenario.world.view import WorldView

TICK = 0.05
RATE = 10.0
SIZE = 300
SPEED = 25.0
LENGTH = 2000.0
NOTHING = Detections(0.0)
TECHNOLOGIES = ("80211p", "cv2x_mode4")


def antenna_position(row: int, stations: int, now: float) -> tuple[float, float, float]:
    """Return the antenna position of a car on an endless road."""
    half = stations // 2
    along = (row % half) * LENGTH / half + (SPEED * now if row < half else -SPEED * now)
    return along, 0.0 if row < half else 4.0, 1.6


@cache
def trucks(stations: int) -> LineOfSightStates:
    """Return line-of-sight states with a truck between every tenth pair; no rays are cast."""
    first, second = np.triu_indices(stations, 1)
    blocked = (first + second) % 10 == 0
    obstructions: dict[int, tuple[str, ...]] = {int(pair): ("Truck",) for pair in np.flatnonzero(blocked)}
    return LineOfSightStates(np.where(blocked, NLOSV, LOS), np.where(blocked, 3.0, -np.inf), obstructions)


def view_of(places: dict[str, tuple[float, float, float]], tick: int) -> WorldView:
    """Return the view that enters the hash in addition to the outcomes."""
    count = len(places)
    zeros, vectors = np.zeros(count), np.zeros((count, 3))
    position, size = np.array(list(places.values())), np.ones((count, 3))
    return WorldView(
        TICK * tick, tick, tuple(places), ("car",) * count, position, zeros, zeros, zeros, vectors, vectors, zeros,
        zeros, size, vectors,
    )  # fmt: skip


def run(stations: int, seconds: float, technology: str, create_events: bool) -> tuple[float, RadioChannel]:
    """Return the processor time for `seconds` of radio traffic on one core, and the channel.

    With `create_events`, every outcome also becomes an object, as a recording requires it.
    """
    path_loss = {"kind": "tr37885", "environment": "highway"}
    profile = {"technology": technology, "path_loss": path_loss, "jitter": TICK, "queue": {"discipline": "lcfs"}}
    channel = RadioChannel(RadioProfile.model_validate(profile), seed=1)
    names = [f"{row:03d}" for row in range(stations)]
    others = {name: [other for other in names if other != name] for name in names}
    period = round(1.0 / RATE / TICK)
    trace = TraceHash()
    started = time.process_time()
    for tick in range(round(seconds / TICK)):
        now = tick * TICK
        places = {name: antenna_position(row, stations, now) for row, name in enumerate(names)}
        channel.update_environment(RadioEnvironment(places, lambda pairs: trucks(stations)))
        for name in names:
            channel.deliver(name, now)
        outbox = [
            (
                Message(name, tick // period, now, StationState(now, *places[name], 0.0, SPEED), NOTHING, SIZE),
                others[name],
            )
            for row, name in enumerate(names)
            if (tick + row) % period == 0
        ]
        events = channel.transmit(outbox, now)
        trace.observe(Frame(view_of(places, tick), links=events))
        if create_events:
            for _ in events:
                pass
    return time.process_time() - started, channel


@contextmanager
def complete_simulation(
    stations: int, seconds: float, rate: float | None, all_listen: bool, sight: str, length: float = LENGTH
) -> Iterator[Simulation]:
    """Yield a loaded run of a generated scenario, whose stations start on `length` meters of a road."""
    channel = (
        f"{{model: radio, jitter: {TICK}, line_of_sight: {sight}, path_loss: {{kind: tr37885, environment: highway}}}}"
    )
    with TemporaryDirectory() as folder:
        path = write_scenario(Path(folder), stations, rate=rate, all_listen=all_listen, length=length)
        settings = RunSettings(dt=TICK, channel=channel, time_limit=seconds)
        with Simulation(load_for_seed(path, 1, {}), seed=1, settings=settings) as simulation:
            yield simulation


def complete_run(
    stations: int, seconds: float, rate: float | None, all_listen: bool, sight: str, length: float = LENGTH
) -> float:
    """Return the simulated time per processor time, without loading and the final statistics.

    The times of n ticks are those of n steps, though the last tick is at n - 1 steps: short runs count in full.
    """
    with complete_simulation(stations, seconds, rate, all_listen, sight, length) as simulation:
        gc.collect()  # what loading left; the command line collects garbage rarely
        started = time.process_time()
        end, ticks = None, 0
        while end is None:
            _, end = simulation.tick()
            ticks += 1
        return TICK * ticks / (time.process_time() - started)


def received_messages(stations: int, seconds: float, rate: float | None) -> float:
    """Return the messages that a station receives per tick, if all receive."""
    with complete_simulation(stations, seconds, rate, True, "random") as simulation:
        end, ticks, received = None, 0, 0
        while end is None:
            frame, end = simulation.tick()
            ticks += 1
            received += sum(len(step.inbox) for step in frame.steps.values())
        return received / ticks / stations


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--technology", choices=TECHNOLOGIES)
    parser.add_argument("--profile", action="store_true", help="print the functions that take the most time")
    parser.add_argument("--repetitions", type=int, default=3)
    options = parser.parse_args()
    print(f"{options.stations} stations at {RATE:g} Hz, {SIZE} bytes, {options.seconds:g} s, one core")
    for technology in (options.technology,) if options.technology else TECHNOLOGIES:
        for create_events in (False, True):
            minimum = min(
                run(options.stations, options.seconds, technology, create_events)[0] for _ in range(options.repetitions)
            )
            description = "with one object per outcome" if create_events else "messages, statistics and hash"
            aim = "" if create_events else "   (aim: above 1)"
            print(f"  {technology:11} {description:28} {options.seconds / minimum:6.2f} times real time{aim}")
        _, channel = run(options.stations, options.seconds, technology, False)
        start = time.process_time()
        statistics = channel.statistics(options.seconds).values()
        duration = time.process_time() - start
        sent, received = sum(link.sent for link in statistics), sum(link.received for link in statistics)
        busy = np.mean([channel.channel_busy_ratio(f"{row:03d}") or 0.0 for row in range(options.stations)])
        print(
            f"  {technology:11} {sent} outcomes, {100 * received / sent:.1f} % received, channel busy ratio {busy:.3f}"
        )
        print(f"  {technology:11} final statistics of {len(statistics)} links take {duration:.2f} s, once")
        if options.profile:
            profile = cProfile.Profile()
            profile.runcall(run, options.stations, options.seconds, technology, False)
            pstats.Stats(profile).sort_stats("tottime").print_stats(22)
    if options.technology is not None:
        return
    print(f"complete runs with {options.stations} stations that send CAM, IEEE 802.11p")
    for rate, all_listen, sight, seconds in (
        (RATE, False, "random", 1.0),
        (None, False, "random", 1.0),
        (RATE, False, "rays", 0.5),
        (RATE, True, "random", 0.3),
    ):
        best = max(complete_run(options.stations, seconds, rate, all_listen, sight) for _ in range(options.repetitions))
        generation = f"{rate:g} Hz" if rate is not None else "by ETSI generation rules"
        description = f"{generation}, {'all receive' if all_listen else 'one receives'}, line of sight {sight}"
        print(f"  {description:58} {best:6.2f} times real time")


if __name__ == "__main__":
    main()
