"""Plays scenarios without a physics engine, and measures how far they go from recorded reference traces.

As a program it prints a table: `python tests/behaviors/reference_player.py [NAME…]`, with EIDRIVE_CORPORA set.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
import sys
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from eidrive_scenario.errors import EidriveError
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.states import StateChange
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.view import WorldView

POSITION_LIMIT = 0.1
EVENT_LIMIT = 0.0501

Row = tuple[float, float, float, float, float, float, float]
"""x y z h p r speed"""


class KinematicWorld:
    """A world without forces: everybody is exactly where the storyboard puts them."""

    def __init__(self, scenario: Scenario, dt: float) -> None:
        self.dt = dt
        self.tick = 0
        self.placements: dict[str, Placement] = {}
        self._entities = scenario.entities
        self._velocity: dict[str, tuple[float, float, float]] = {}
        self._acceleration: dict[str, tuple[float, float, float]] = {}

    def add(self, additions: Mapping[str, Placement]) -> None:
        for name, placement in additions.items():
            self.placements[name] = placement
            self._velocity[name] = _along(placement)
            self._acceleration[name] = (0.0, 0.0, 0.0)

    def remove(self, names: set[str]) -> None:
        for name in names:
            self.placements.pop(name, None)

    def move(self, placements: Mapping[str, Placement]) -> None:
        for name, after in placements.items():
            before = self.placements[name]
            velocity = tuple((b - a) / self.dt for a, b in zip(_position(before), _position(after), strict=True))
            if after.teleport:
                velocity = _along(after)
            old = self._velocity[name]
            self._acceleration[name] = tuple((b - a) / self.dt for a, b in zip(old, velocity, strict=True))
            self._velocity[name] = velocity
            self.placements[name] = after
        self.tick += 1

    def view(self) -> WorldView:
        names = tuple(self.placements)
        rows = [self.placements[name] for name in names]
        boxes = [self._entities[name].bounding_box for name in names]
        count = len(names)
        return WorldView(
            time=self.tick * self.dt,
            tick=self.tick,
            names=names,
            categories=("car",) * count,
            position=np.array([_position(p) for p in rows]).reshape(count, 3),
            yaw=np.array([p.yaw for p in rows]),
            pitch=np.array([p.pitch for p in rows]),
            roll=np.array([p.roll for p in rows]),
            velocity=np.array([self._velocity[name] for name in names]).reshape(count, 3),
            acceleration=np.array([self._acceleration[name] for name in names]).reshape(count, 3),
            yaw_rate=np.zeros(count),
            speed=np.array([p.speed for p in rows]),
            size=np.array([[b.dimensions.length, b.dimensions.width, b.dimensions.height] for b in boxes]).reshape(
                count, 3
            ),
            offset=np.array([[b.center.x, b.center.y, b.center.z] for b in boxes]).reshape(count, 3),
        )


def _position(placement: Placement) -> tuple[float, float, float]:
    return placement.x, placement.y, placement.z


def _along(placement: Placement) -> tuple[float, float, float]:
    return placement.speed * math.cos(placement.yaw), placement.speed * math.sin(placement.yaw), 0.0


@dataclass
class Run:
    """What a play came to: rows by time (in hundredths of a second) and name, state changes, and its end."""

    rows: dict[int, dict[str, Row]] = field(default_factory=lambda: defaultdict(dict))
    changes: list[StateChange] = field(default_factory=list)
    ended: str | None = None
    seconds: float = 0.0
    ticks: int = 0
    cpu: float = 0.0
    controlled: frozenset[str] = frozenset()


def play(path: Path, *, dt: float = 0.01, limit: float = 120.0) -> Run:
    """Play a scenario file to its end or to the time limit [s]."""
    scenario = load_scenario(path)
    roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    storyboard = Storyboard(scenario, roads, dt=dt)
    world = KinematicWorld(scenario, dt)
    run = Run(controlled=frozenset(name for name, held in scenario.controllers.items() if held))
    world.add(storyboard.initial().additions)
    started = time.process_time()
    while True:
        view = world.view()
        mark = round(view.time * 100)
        if mark % 10 == 0:
            for name, p in world.placements.items():
                run.rows[mark][name] = (p.x, p.y, p.z, p.yaw, p.pitch, p.roll, p.speed)
        commands = storyboard.tick(view)
        run.changes += storyboard.changes
        run.ended, run.seconds, run.ticks = storyboard.ended, view.time, view.tick
        if run.ended is not None or view.time >= limit:
            break
        world.add(commands.additions)
        world.remove(commands.removals)
        world.move(commands.placements)
    run.cpu = time.process_time() - started
    return run


@dataclass(frozen=True)
class Deviation:
    """How far a run is from its reference: root mean square and largest distance per actor [m], worst state change."""

    position: dict[str, tuple[float, float]]
    controlled: frozenset[str]
    """Actors with a controller of another engine, who may drive by it in the reference: shown, but not counted."""
    events: float
    missing: tuple[str, ...]
    late: tuple[str, ...]
    run: Run

    @property
    def rms(self) -> float:
        """The worst actor's."""
        counted = [rms for actor, (rms, _) in self.position.items() if actor not in self.controlled]
        return max(counted, default=0.0)

    @property
    def agrees(self) -> bool:
        """Within 0.1 m and 0.05 s."""
        return self.rms < POSITION_LIMIT and not self.late and not self.missing


def compare(path: Path, reference: Path, name: str) -> Deviation:
    """Play a file and compare it with its reference up to the reference's end."""
    recorded: dict[int, dict[str, Row]] = defaultdict(dict)
    with gzip.open(reference / f"{name}.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            values = [float(row[key]) for key in ("x", "y", "z", "h", "p", "r", "speed")]
            recorded[round(float(row["time"]) * 100)][row["name"]] = tuple(values)
    last = max(recorded) / 100
    run = play(path, limit=last + 1.0)
    squares: dict[str, list[float]] = defaultdict(list)
    for mark, actors in recorded.items():
        for actor, row in actors.items():
            mine = run.rows.get(mark, {}).get(actor)
            if mine is not None:
                squares[actor].append(math.dist(mine[:2], row[:2]))
    position = {
        actor: (math.sqrt(sum(d * d for d in found) / len(found)), max(found)) for actor, found in squares.items()
    }
    worst, missing, late = _events(run, reference / f"{name}.events.csv")
    return Deviation(position, run.controlled, worst, missing, late, run)


def _events(run: Run, path: Path) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """The largest difference in time between a recorded state change and the nearest like it, and those never made."""
    mine: dict[tuple[str, str], list[float]] = defaultdict(list)
    for change in run.changes:
        name = "storyBoard" if change.kind == "storyboard" else change.element
        mine[name, change.after.value].append(change.time)
    worst, missing = 0.0, []
    late = []
    with path.open() as file:
        for row in csv.DictReader(file):
            if row["element"].startswith("Init ") or row["to"] == "standbyState":
                continue
            times = mine.get((row["element"], row["to"]))
            if not times:
                missing.append(f"{row['element']}→{row['to']}@{row['time']}")
                continue
            off = min(abs(float(row["time"]) - moment) for moment in times)
            worst = max(worst, off)
            if off > EVENT_LIMIT:
                late.append(f"{row['element']}→{row['to']}@{row['time']} is off by {off:.3f} s")
    return worst, tuple(missing), tuple(late)


FOLDERS = {
    "esmini": "esmini/xosc",
    "ALKS": "alks/concrete_scenarios",
    "ASAM-1.3.1": "asam-1.3.1",
    "ASAM-1.2.0": "asam-1.2.0",
}


def source_of(corpora: Path, name: str) -> Path:
    """The scenario file of a reference trace."""
    corpus, _, file = name.partition("__")
    return corpora / FOLDERS[corpus] / f"{file}.xosc"


def comparable(corpora: Path) -> list[str]:
    """The names of the reference traces that can be compared."""
    lines = (corpora / "reference" / "comparable.txt").read_text().splitlines()
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def main(names: list[str]) -> None:
    """Print the table."""
    corpora = Path(os.environ["EIDRIVE_CORPORA"])
    agreed = 0
    chosen = names or comparable(corpora)
    for name in chosen:
        try:
            found = compare(source_of(corpora, name), corpora / "reference", name)
        except EidriveError as error:
            sys.stdout.write(f"{name:62s} {str(error).splitlines()[0][-150:]}\n")
            continue
        except Exception as error:
            sys.stdout.write(f"{name:62s} {type(error).__name__}: {error}\n")
            if names:
                raise
            continue
        good = found.agrees
        agreed += good
        speed = found.run.cpu / max(found.run.ticks, 1) * 1e6
        sys.stdout.write(
            f"{name:62s} {'ok ' if good else '   '} rms {found.rms:8.3f} m  events {found.events:7.3f} s  "
            f"missing {len(found.missing)}  {found.run.ended or 'goes on'} at {found.run.seconds:.2f}, "
            f"{speed:.0f} us a tick\n"
        )
        if names:
            for actor, (rms, worst) in found.position.items():
                sys.stdout.write(f"    {actor}: rms {rms:.3f} m, at most {worst:.3f} m\n")
            for text in (*found.missing, *found.late):
                sys.stdout.write(f"    {text}\n")
            for change in found.run.changes:
                sys.stdout.write(f"    {change.time:7.3f} {change.path} {change.after.value} {change.why}\n")
    sys.stdout.write(f"{agreed} of {len(chosen)} agree\n")


if __name__ == "__main__":
    main(sys.argv[1:])
