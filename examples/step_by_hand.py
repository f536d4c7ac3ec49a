"""Step a run by hand and write what the ego perceives, received and did to a CSV file.

    python examples/step_by_hand.py coop/scenario_2 --channel paper --station Ego --out ego.csv

One row per tick: time [s], speed [m/s], number of own detections, messages received, objects after fusion, throttle,
brake, and the planner's reason.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from eidrive_scenario.api.run import RunSettings, Simulation

COLUMNS = ("time", "speed", "detections", "messages", "objects", "throttle", "brake", "reason")


def rows(simulation: Simulation, station: str) -> Iterator[tuple[object, ...]]:
    """Yield one row per tick until the run ends."""
    end: str | None = None
    while end is None:
        frame, end = simulation.tick()
        step = frame.steps.get(station)
        if step is None:
            continue
        speed = float(frame.view.speed[frame.view.row(station)])
        control, plan = step.control, step.plan
        yield (
            round(frame.view.time, 3),
            round(speed, 3),
            len(step.detections),
            len(step.inbox),
            len(step.fused),
            "" if control is None else round(control.throttle, 3),
            "" if control is None else round(control.brake, 3),
            "" if plan is None else plan.reason,
        )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenario", nargs="?", default="coop/scenario_1")
    parser.add_argument("--channel", default="ideal")
    parser.add_argument("--station", default="Ego")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("station.csv"))
    given = parser.parse_args(arguments)
    settings = RunSettings(channel=given.channel)
    with Simulation(given.scenario, seed=given.seed, settings=settings) as simulation:
        if given.station not in simulation.stack.settings:
            parser.error(f"no station {given.station!r}; stations: {', '.join(simulation.stack.settings)}")
        with given.out.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(COLUMNS)
            writer.writerows(rows(simulation, given.station))
        result = simulation.result()
    print(result)
    print(given.out)


if __name__ == "__main__":
    main()
