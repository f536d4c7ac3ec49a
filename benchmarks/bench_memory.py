"""Resident memory over successive runs in one process: a scenario, or a driven vehicle on a road with many objects.

After the first runs, which fill caches, memory must not grow: the aim is less than 20 MB after the tenth run. Each run
has another seed. Without `--scenario` and `--road` the script writes a straight road with `--objects` posts. ASAM's
`AB_RQ31_R2000.xodr` (OpenDRIVE examples) has objects that become 14,000 boxes; pass its path and a drivable lane.

    python benchmarks/bench_memory.py [--runs 200] [--scenario coop/scenario_1 | --road FILE --lane -2]
        [--seconds 2] [--detector oracle]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

from cars import VEHICLE, start

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings, run_file

ROAD = """<OpenDRIVE><header revMajor="1" revMinor="7"/><road id="1" length="4000" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="4000"><line/></geometry></planView><lanes><laneSection s="0"><center>
<lane id="0" type="none"/></center><right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/>
</lane></right></laneSection></lanes><objects>{objects}</objects></road></OpenDRIVE>"""
POST = '<object id="{0}" type="pole" s="{1}" t="{2}" zOffset="0" hdg="0" radius="0.1" height="1"/>'
SCENARIO = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" description="" author=""/>
<CatalogLocations/><RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork><Entities><ScenarioObject name="Ego">
{vehicle}<ObjectController><Controller name="station"><Properties><Property name="module" value="eidrive"/>
</Properties></Controller></ObjectController></ScenarioObject></Entities><Storyboard><Init><Actions>{start}</Actions>
</Init><StopTrigger/></Storyboard></OpenSCENARIO>"""


def write_road(folder: Path, objects: int) -> Path:
    """Write a straight road with posts on both sides."""
    posts = "".join(POST.format(row, 4000 * row / objects, 3.0 if row % 2 else -6.0) for row in range(objects))
    path = folder / "road.xodr"
    path.write_text(ROAD.format(objects=posts))
    return path


def write_scenario(folder: Path, road: Path, lane: int) -> Path:
    """Write a scenario of one driven car on the first road of a file."""
    road_id = next(iter(RoadNetwork.load(road).roads))
    path = folder / "memory.xosc"
    actions = start("Ego", road_id, lane, "200", "20", active="true")
    path.write_text(SCENARIO.format(road=road.resolve(), vehicle=VEHICLE, start=actions))
    return path


def resident() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--scenario", help="name of a scenario of the library, or path")
    parser.add_argument("--seconds", type=float, help="time limit of each run [s] (default: 2; with a scenario 120)")
    parser.add_argument("--road", type=Path)
    parser.add_argument("--lane", type=int, default=-1)
    parser.add_argument("--objects", type=int, default=10_000, help="number of objects of the generated road")
    parser.add_argument("--detector", default="oracle")
    options = parser.parse_args()
    if options.runs <= 10:
        parser.error("--runs must be above 10: the growth is that after the tenth run")
    seconds = options.seconds or (2.0 if options.scenario is None else 120.0)
    settings = RunSettings(time_limit=seconds, detector=options.detector)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.scenario is not None:
            scenario = resolve_scenario(options.scenario)
        else:
            road = options.road if options.road is not None else write_road(folder, options.objects)
            scenario = write_scenario(folder, road, options.lane)
        started, after_tenth_run = time.perf_counter(), 0.0
        for run in range(1, options.runs + 1):
            run_file(scenario, seed=run, settings=settings)
            if run == 10:
                after_tenth_run = resident()
            if run in (1, 2, 5, 10, options.runs) or run % 20 == 0:
                print(f"run {run:4}: {resident():7.1f} MB, {time.perf_counter() - started:7.1f} s", flush=True)
    print(f"growth after the tenth run: {resident() - after_tenth_run:.1f} MB (aim: less than 20 MB)")


if __name__ == "__main__":
    main()
