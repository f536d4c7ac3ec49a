"""How fast the radio is: 200 stations at 10 Hz on one channel, sending, contending, receiving and being heard.

Cars stand every 20 m on each of two lanes of a 2 km road and drive at 25 m/s; every tenth line of sight is blocked by a
truck. All stations listen to all others, so each simulated second decides 398,000 fates. A tick does all that a run
does for the radio: messages are given out, said and sent, and what became of them enters the hash of the trace. Times
are those of the processor, summed over threads, and the least of some repetitions.

Then whole runs: 200 scripted cars of a generated scenario send CAM, at 10 Hz or by the rules of ETSI, and one of them
listens, or all do, each with fusion of its own. What stands between the antennas is drawn, or found by 19,900 rays.

    python benchmarks/bench_radio.py [--stations 200] [--seconds 3] [--technology 80211p] [--repetitions 3]
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from radio_scenes import write_scenario

from eidrive_scenario.detections import Detections
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


def place(row: int, stations: int, now: float) -> tuple[float, float, float]:
    """Antenna of a car that goes round and round the road."""
    half = stations // 2
    along = (row % half) * LENGTH / half + (SPEED * now if row < half else -SPEED * now)
    return along, 0.0 if row < half else 4.0, 1.6


@cache
def trucks(stations: int) -> LineOfSightStates:
    """Every tenth pair has a truck in between; no rays are cast here."""
    first, second = np.triu_indices(stations, 1)
    blocked = (first + second) % 10 == 0
    behind: dict[int, tuple[str, ...]] = {int(pair): ("Truck",) for pair in np.flatnonzero(blocked)}
    return LineOfSightStates(np.where(blocked, NLOSV, LOS), np.where(blocked, 3.0, -np.inf), behind)


def view_of(places: dict[str, tuple[float, float, float]], tick: int) -> WorldView:
    """What the hash takes in beside the fates."""
    count = len(places)
    zeros, vectors = np.zeros(count), np.zeros((count, 3))
    position, size = np.array(list(places.values())), np.ones((count, 3))
    return WorldView(
        TICK * tick, tick, tuple(places), ("car",) * count, position, zeros, zeros, zeros, vectors, vectors, zeros,
        zeros, size, vectors,
    )  # fmt: skip


def run(stations: int, seconds: float, technology: str, look: bool) -> tuple[float, RadioChannel]:
    """Seconds of one core for `seconds` of traffic; with `look` every fate is made into an object, too, as a
    recording of the run needs it."""
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
        places = {name: place(row, stations, now) for row, name in enumerate(names)}
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
        if look:
            for _ in events:
                pass
    return time.process_time() - started, channel


def whole_run(stations: int, seconds: float, rate: float | None, all_listen: bool, sight: str) -> float:
    """Simulated seconds per second of the processor, loading and the books at the end aside."""
    channel = (
        f"{{model: radio, jitter: {TICK}, line_of_sight: {sight}, path_loss: {{kind: tr37885, environment: highway}}}}"
    )
    with TemporaryDirectory() as folder:
        path = write_scenario(Path(folder), stations, rate=rate, all_listen=all_listen)
        settings = RunSettings(dt=TICK, channel=channel, time_limit=seconds)
        with Simulation(load_for_seed(path, 1, {}), seed=1, settings=settings) as simulation:
            started = time.process_time()
            end = None
            while end is None:
                frame, end = simulation.tick()
            return frame.view.time / (time.process_time() - started)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--technology", choices=["80211p", "cv2x_mode4"], default=None)
    parser.add_argument("--profile", action="store_true", help="say where the time goes")
    parser.add_argument("--repetitions", type=int, default=3)
    given = parser.parse_args()
    print(f"{given.stations} stations at {RATE:g} Hz, {SIZE} bytes, {given.seconds:g} s, one core")
    for technology in (given.technology,) if given.technology else ("80211p", "cv2x_mode4"):
        for look in (False, True):
            least = min(run(given.stations, given.seconds, technology, look)[0] for _ in range(given.repetitions))
            what = "with an object for each fate" if look else "messages, books and hash"
            aim = "" if look else "   (aim: above 1)"
            print(f"  {technology:11} {what:28} {given.seconds / least:6.2f} times real time{aim}")
        _, channel = run(given.stations, given.seconds, technology, False)
        begin = time.process_time()
        books = channel.statistics(given.seconds).values()
        reading = time.process_time() - begin
        sent, received = sum(book.sent for book in books), sum(book.received for book in books)
        busy = np.mean([channel.channel_busy_ratio(f"{row:03d}") or 0.0 for row in range(given.stations)])
        print(f"  {technology:11} {sent} fates, {100 * received / sent:.1f} % heard, busy ratio {busy:.3f}")
        print(f"  {technology:11} to read the books of {len(books)} links at the end takes {reading:.2f} s, once")
        if given.profile:
            profile = cProfile.Profile()
            profile.runcall(run, given.stations, given.seconds, technology, False)
            pstats.Stats(profile).sort_stats("tottime").print_stats(22)
    if given.technology is not None:
        return
    print(f"whole runs with {given.stations} stations that send CAM, IEEE 802.11p")
    for rate, all_listen, sight, seconds in (
        (RATE, False, "random", 1.0),
        (None, False, "random", 1.0),
        (RATE, False, "rays", 0.5),
        (RATE, True, "random", 0.3),
    ):
        best = max(whole_run(given.stations, seconds, rate, all_listen, sight) for _ in range(given.repetitions))
        said = f"{rate:g} Hz" if rate is not None else "by the rules of ETSI"
        what = f"{said}, {'all listen' if all_listen else 'one listens'}, line of sight {sight}"
        print(f"  {what:58} {best:6.2f} times real time")


if __name__ == "__main__":
    main()
