"""Mutants of all scenarios and roads of the library, and of the corpora where they are present, through check and run.

    PYTHONPATH=tests/shared python tests/engine/hostile/shared/campaign.py --count 3000 --out mutants

prints a line for each mutant that ends in an internal error, blocks, or needs too much time or memory, and keeps its
file. The mutants of a seed are the same on every machine with the same files. Set OPENBLAS_NUM_THREADS and
OMP_NUM_THREADS to 1: each trial is a fork.
"""

from __future__ import annotations

import argparse
import collections
import os
import random
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.sax.saxutils import escape

from mutants import mutant
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import init_xml, lane_position_xml, speed_xml, teleport_xml
from trial import TIME_LIMIT, Outcome, attempt

from eidrive_scenario.checks.scenario_checks import check_road_file, check_scenario
from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import definition, library_path
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings, Simulation

LARGEST = 600_000
"""Bytes of a file that is mutated: of the largest maps one run takes minutes."""
GOOD = ("played", "refused")


@dataclass(frozen=True)
class Case:
    """A mutant: the file that it comes from, the folder that its paths may lead through, its number."""

    source: Path
    root: Path
    number: int


def sources() -> list[tuple[Path, Path]]:
    """Scenario and road files, each with the folder within which its relative paths lie; the small ones."""
    roots = [library_path()]
    roots += [Path(os.environ[name]) for name in ("EIDRIVE_CORPORA",) if os.environ.get(name)]
    found = []
    for root in roots:
        files = [path for suffix in ("xosc", "xodr") for path in root.rglob(f"*.{suffix}")]
        found += [(path, root) for path in sorted(files) if path.stat().st_size <= LARGEST]
    return found


def cases(seed: int, count: int) -> Iterator[Case]:
    """Mutants in an order that has scenarios and roads of all folders early."""
    draw = random.Random(seed)
    known = sources()
    while count > 0:
        draw.shuffle(known)
        for path, root in known[:count]:
            count -= 1
            yield Case(path, root, count)


def try_case(case: Case, seed: int, folder: Path) -> tuple[Outcome, Path]:
    """The outcome of a case, and the mutant's file, which lies among links to all that the original lies among."""
    path = _mirrored(case, folder)
    path.write_bytes(mutant(case.source.read_bytes(), seed, case.number))
    if path.suffix == ".xodr":
        return attempt(path, run=partial(_drive_on, scenario=_scenario_on(case.source))), path
    return attempt(path, run=_check_and_run), path


def _mirrored(case: Case, folder: Path) -> Path:
    place, inside = folder, case.source.relative_to(case.root)
    original = case.root
    for part in inside.parts:
        place.mkdir(exist_ok=True)
        for entry in original.iterdir():
            if entry.name != part:
                (place / entry.name).symlink_to(entry.resolve())
        original, place = original / part, place / part
    return place


def _check_and_run(path: Path) -> None:
    kind = definition(path)
    if kind == "catalog":
        from eidrive_scenario.openscenario import read_document

        read_document(path)
        return
    if kind == "distribution":
        runs = load_distribution(path)
        check_scenario(runs.scenario)
        for number in runs.spread(3):
            scenario = load_scenario(runs.scenario, runs[number].assignments)
            Simulation(scenario, seed=1, settings=RunSettings(time_limit=0.2)).run()
        return
    check_scenario(path)
    Simulation(load_scenario(path), seed=1, settings=RunSettings(time_limit=TIME_LIMIT)).run()


def _drive_on(path: Path, scenario: str) -> None:
    check_road_file(path)
    text = scenario.replace("ROADS", str(path)).encode()
    Simulation(load_scenario(text), seed=1, settings=RunSettings(time_limit=TIME_LIMIT)).run()


def _scenario_on(source: Path) -> str:
    """A scenario with an agent and another car on the first road of the original that takes them."""
    try:
        network = RoadNetwork.load(source)
        place = next(
            (road.id, lane.id)
            for road in network.roads.values()
            if road.length > 20.0
            for lane in road.sections[0].lanes.values()
            if lane.type == "driving"
        )
    except (InputError, StopIteration):
        place = ("0", -1)
    agent = agent_xml(detector="lidar", obey_signals="true")
    positions = {"Ego": 1.0, "Other": 14.0}
    return scenario_xml(
        road=road_file_xml("ROADS"),
        entities="".join(object_xml(name, controller=agent if name == "Ego" else "") for name in positions),
        init="".join(
            init_xml(
                name, teleport_xml(lane_position_xml(place[1], s, escape(place[0], {'"': "&quot;"}))), speed_xml(10)
            )
            for name, s in positions.items()
        ),
    ).decode()


def main() -> int:
    """Run the campaign; the exit code is 1 if a mutant was not handled."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="mutants to skip")
    parser.add_argument("--step", type=int, default=1, help="take each N-th mutant")
    parser.add_argument("--out", type=Path, default=Path("mutants"), help="folder for mutants that were not handled")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    kinds: collections.Counter[str] = collections.Counter()
    worst_cpu = worst_peak = 0.0
    for case in list(cases(given.seed, given.count))[given.first :: given.step]:
        with tempfile.TemporaryDirectory(dir=given.out) as folder:
            outcome, path = try_case(case, given.seed, Path(folder) / "m")
            kinds[outcome.kind] += 1
            worst_cpu, worst_peak = max(worst_cpu, outcome.cpu_s), max(worst_peak, outcome.peak_mb)
            slow = outcome.cpu_s > 20.0 or outcome.peak_mb > 1200.0
            if outcome.kind not in GOOD or slow:
                name = f"{case.number}-{path.name}"
                shutil.copy(path, given.out / name)
                numbers = f"{outcome.cpu_s:.1f} s, {outcome.peak_mb:.0f} MB"
                _report(f"{outcome.kind}: {name} of {case.source} ({numbers})\n{outcome.detail}\n")
        if sum(kinds.values()) % 100 == 0:
            _report(f"{dict(kinds)} {worst_cpu:.1f} s, {worst_peak:.0f} MB at most")
    _report(f"end: {dict(kinds)} {worst_cpu:.1f} s, {worst_peak:.0f} MB at most")
    return int(any(kind not in GOOD for kind in kinds))


def _report(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
