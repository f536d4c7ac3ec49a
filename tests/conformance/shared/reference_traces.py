"""Runs of third-party scenarios, and their deviations from recorded reference traces.

As a program it prints a table: `python tests/conformance/shared/reference_traces.py [NAME…]`, with EIDRIVE_CORPORA set.
"""

from __future__ import annotations

import csv
import gzip
import math
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from eidrive_scenario.errors import EidriveError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.kinematics.trailers import couplings
from eidrive_scenario.storyboard.state.element_states import StateChange

RMS_LIMIT = 0.10
"""Maximum root mean square distance to the reference over time [m]."""
WORST_LIMIT = 0.5
"""Maximum distance to the reference at any time [m]."""
HEADING_LIMIT = 0.02
"""Maximum root mean square heading difference over time [rad]."""
EVENT_LIMIT = 0.05
"""Maximum time difference of state changes [s]."""
ROUNDING = 1e-6
ENDINGS = {"endTransition", "stopTransition"}
"""Transitions to completeState. The reference deviates from the standard in three cases: it ends overridden elements
and parents of a stopped action, where the standard stops them; it stops immediately completed actions, where the
standard ends them. State and time are still compared."""

LINE = "line of the reference table"
"""Name of the property with the table line of a test."""

END = "how a scenario of the corpora ended"
"""Name of the property with the end of the run of a test."""

CONTROLLER_MODELS = {
    "ACCController": "adaptive_cruise",
    "ALKSController": "adaptive_cruise",
    "ALKS_R157SM_Controller": "alks",
    "ExternalController": "external",
    "InteractiveController": "external",
}
"""Controllers of esmini in the reference recordings, with their controller models."""

FOLDERS = {
    "esmini": "esmini/xosc",
    "ALKS": "alks/concrete_scenarios",
    "ASAM-1.3.1": "asam-1.3.1",
    "ASAM-1.2.0": "asam-1.2.0",
}

Row = tuple[float, float, float]
"""x [m], y [m], heading [rad]"""
Changes = dict[tuple[str, str], list[tuple[float, str]]]
"""By element and the state after it: times and transitions."""
Rows = Mapping[int, Mapping[str, Row]]
"""By hundredths of a second and name."""


@dataclass
class Run:
    """Result of a run."""

    rows: dict[int, dict[str, Row]] = field(default_factory=lambda: defaultdict(dict))
    changes: list[StateChange] = field(default_factory=list)
    ended: str = ""
    seconds: float = 0.0
    ticks: int = 0
    cpu: float = 0.0
    played_by: tuple[str, ...] = ()
    """Controller models of esmini controllers in the run."""


@dataclass(frozen=True)
class Drift:
    """Deviation of one actor from its reference."""

    rms: float
    worst: float
    heading: float
    absent: int
    """Number of instants at which only one of the two runs has the actor."""

    @property
    def within(self) -> bool:
        return (
            self.rms <= RMS_LIMIT and self.worst <= WORST_LIMIT and self.heading <= HEADING_LIMIT and self.absent <= 1
        )


@dataclass(frozen=True)
class Deviation:
    """Deviation of a run from its reference."""

    actors: Mapping[str, Drift]
    events: float
    """Maximum time difference of state changes that both runs have [s]."""
    unmatched: tuple[str, ...]
    """State changes with a time difference above the limit, or in only one of the runs."""
    renamed: int
    """State changes that are ends in one run and stops in the other one."""
    run: Run

    @property
    def agrees(self) -> bool:
        return not self.unmatched and all(drift.within for drift in self.actors.values())

    def worst(self, measure: str) -> float:
        """Return the maximum of a measure over the actors."""
        return max((getattr(drift, measure) for drift in self.actors.values()), default=0.0)


def play(path: Path, *, limit: float) -> Run:
    """Run a scenario file in steps of 0.01 s to its end or to the time limit [s]."""
    settings = RunSettings(dt=0.01, time_limit=limit, controllers=CONTROLLER_MODELS)
    simulation = Simulation(load_scenario(path), settings=settings)
    held = [one.name for controllers in simulation.scenario.controllers.values() for one in controllers]
    models = {CONTROLLER_MODELS[name] for name in held if name in CONTROLLER_MODELS}
    run, end = Run(played_by=tuple(sorted(models))), None
    started = time.process_time()
    with simulation:
        names = _names(simulation)
        while end is None:
            frame, end = simulation.tick()
            run.changes += frame.changes
            if frame.view.tick % 10 == 0:
                _keep(run, frame, names)
    run.cpu = time.process_time() - started
    run.ended, run.seconds, run.ticks = end, frame.view.time, frame.view.tick
    return run


def _names(simulation: Simulation) -> dict[str, str]:
    """Return trailers defined inside their towing vehicle, by their name in the reference: its name and `+`."""
    entities = simulation.scenario.document.entities
    assert entities is not None
    declared = {one.name for one in entities.scenario_object}
    names: dict[str, str] = {}
    for front, back, *_ in couplings(simulation.storyboard.context.actors):
        if back.name not in declared:
            names[back.name] = f"{names.get(front.name, front.name)}+"
    return names


def _keep(run: Run, frame: Frame, names: Mapping[str, str]) -> None:
    view = frame.view
    rows = run.rows[view.tick]
    for name, (x, y, _), yaw in zip(view.names, view.position.tolist(), view.yaw.tolist(), strict=True):
        rows[names.get(name, name)] = (x, y, yaw)


def compare(path: Path, reference: Path, name: str) -> Deviation:
    """Run a file and compare it with its reference up to the end of the reference."""
    recorded = _recorded(reference / f"{name}.csv.gz")
    run = play(path, limit=max(recorded) / 100 + 1.0)
    worst, unmatched, renamed = _events(run, reference / f"{name}.events.csv", max(recorded) / 100)
    return Deviation(dict(_drifts(run.rows, recorded)), worst, unmatched, renamed, run)


def _recorded(path: Path) -> Rows:
    rows: dict[int, dict[str, Row]] = defaultdict(dict)
    with gzip.open(path, "rt") as file:
        for row in csv.DictReader(file):
            rows[round(float(row["time"]) * 100)][row["name"]] = (float(row["x"]), float(row["y"]), float(row["h"]))
    return rows


def _drifts(mine: Rows, recorded: Rows) -> Iterator[tuple[str, Drift]]:
    for actor in sorted({actor for rows in recorded.values() for actor in rows}):
        away, turned, absent = [], [], 0
        for mark, rows in recorded.items():
            theirs, ours = rows.get(actor), mine.get(mark, {}).get(actor)
            if theirs is not None and ours is not None:
                away.append(math.dist(ours[:2], theirs[:2]))
                turned.append(math.remainder(ours[2] - theirs[2], math.tau))
            elif (theirs is None) != (ours is None) and mark in mine:
                absent += 1
        yield actor, Drift(_rms(away), max(away, default=math.inf), _rms(turned), absent)


def _rms(values: list[float]) -> float:
    return math.sqrt(sum(value * value for value in values) / len(values)) if values else math.inf


def _events(run: Run, path: Path, until: float) -> tuple[float, tuple[str, ...], int]:
    """State changes of the reference against ours, the first with the first, the second with the second, and so on.

    The answer: the largest difference in time, what has no partner, and how many a different transition led to.
    """
    mine: Changes = defaultdict(list)
    for change in run.changes:
        if change.transition is not None:
            name = "storyBoard" if change.kind == "storyboard" else change.element
            mine[name, change.after.value].append((change.time, change.transition.value))
    theirs: Changes = defaultdict(list)
    with path.open() as file:
        for row in csv.DictReader(file):
            if not row["element"].startswith("Init ") and row["transition"] != "initToStandbyTransition":
                theirs[row["element"], row["to"]].append((float(row["time"]), row["transition"]))
    worst, unmatched, renamed = 0.0, [], 0
    for key in dict.fromkeys([*theirs, *mine]):
        expected, made = theirs.get(key, []), mine.get(key, [])
        text = f"{key[0]} → {key[1]}"
        for (wanted, word), (moment, name) in zip(expected, made, strict=False):
            worst = max(worst, abs(wanted - moment))
            if abs(wanted - moment) > EVENT_LIMIT + ROUNDING or not (word == name or {word, name} == ENDINGS):
                unmatched.append(f"{text}: {name} at {moment:.2f} instead of {word} at {wanted:.2f}")
            elif word != name:
                renamed += 1
        unmatched += [f"{text}: not at {wanted:.2f}" for wanted, _ in expected[len(made) :]]
        unmatched += [f"{text}: at {moment:.2f} too" for moment, _ in made[len(expected) :] if moment <= until]
    return worst, tuple(unmatched), renamed


def source_of(corpora: Path, name: str) -> Path:
    """Return the scenario file of a reference trace."""
    corpus, _, file = name.partition("__")
    return corpora / FOLDERS[corpus] / f"{file}.xosc"


def comparable(corpora: Path) -> list[str]:
    """Return the names of the reference traces that can be compared."""
    lines = (corpora / "reference" / "comparable.txt").read_text().splitlines()
    return [line.strip() for line in lines if line.strip() and not line.startswith("#")]


def line_of(name: str, found: Deviation) -> str:
    """Return one line of the table."""
    return (
        f"{name:66s} {'ok ' if found.agrees else 'NOT'} rms {found.worst('rms'):7.3f} m  "
        f"max {found.worst('worst'):7.3f} m  heading {found.worst('heading'):6.4f} rad  events {found.events:5.2f} s  "
        f"unmatched {len(found.unmatched):2d}  {found.run.ended} at {found.run.seconds:.2f} s"
        + (f"  with {', '.join(found.run.played_by)}" if found.run.played_by else "")
    )


def main(names: list[str]) -> None:
    """Print the table."""
    corpora = Path(os.environ["EIDRIVE_CORPORA"])
    agreed, chosen = 0, names or comparable(corpora)
    for name in chosen:
        try:
            found = compare(source_of(corpora, name), corpora / "reference", name)
        except EidriveError as error:
            sys.stdout.write(f"{name:66s} NOT {str(error).splitlines()[0][-150:]}\n")
            continue
        agreed += found.agrees
        sys.stdout.write(line_of(name, found) + "\n")
        if names or not found.agrees:
            for actor, drift in found.actors.items():
                if names or not drift.within:
                    sys.stdout.write(
                        f"    {actor}: rms {drift.rms:.3f} m, at most {drift.worst:.3f} m, "
                        f"heading {drift.heading:.4f} rad, {drift.absent} times absent\n"
                    )
            for text in found.unmatched[: None if names else 6]:
                sys.stdout.write(f"    {text}\n")
        if names:
            for change in found.run.changes:
                word = change.transition.value if change.transition is not None else "-"
                sys.stdout.write(f"    {change.time:7.3f} {change.path} {word} {change.after.value} {change.why}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{agreed} of {len(chosen)} agree\n")


if __name__ == "__main__":
    main(sys.argv[1:])
