"""Corner cases of the library with and without messages, and with the faults of their senders.

python -m eidrive_reports.corner_cases --out reports

The output is corner_cases.md, the table of docs/corner_cases.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from operator import attrgetter

from rich.console import Console

from eidrive_reports.driven_runs import CONTACT
from eidrive_reports.paper import EGO
from eidrive_reports.planner_scenes import SceneRun, run_of
from eidrive_reports.studies import command, group_by, markdown_table, publish, study_options
from eidrive_scenario.api.experiments import Job, run_jobs
from eidrive_scenario.api.run import RunSettings

VEHICLE, UNIT = {"Participants": "vehicle"}, {"Participants": "rsu"}
ARMS: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "pedestrian_parked_cars": {"parked car": VEHICLE},
    "wrong_way_driver": {"roadside unit": UNIT},
    "emergency_vehicle": {"ambulance": VEHICLE},
    "tunnel_breakdown": {"truck": VEHICLE},
    "cyclist_right_turn": {"roadside unit": UNIT},
    "jam_end": {"last cars": VEHICLE},
    "ghost": {
        "roadside unit, ghost of score 1": UNIT,
        "roadside unit, ghost of score 0.4": {**UNIT, "GhostScore": "0.4"},
    },
    "contradicting_senders": {
        "right unit": UNIT,
        "wrong unit": {"Participants": "wrong"},
        "both units": {"Participants": "both"},
    },
    "wrong_clock": {
        "roadside unit, right clock": {**UNIT, "ClockOffset": "0"},
        "clock 0.5 s ahead": {**UNIT, "ClockOffset": "0.5"},
        "clock 0.5 s behind": {**UNIT, "ClockOffset": "-0.5"},
        "clock 2.4 s behind": {**UNIT, "ClockOffset": "-2.4"},
    },
    "jammer": {
        "roadside unit, no jammer": {**UNIT, "JammerPower": "-30"},
        "roadside unit, jammer of 30 dBm": UNIT,
    },
}
"""Parameters by scenario and arm, in addition to the arm without messages."""
ALONE = "none"
"""Name of the arm without messages."""


def jobs(scenarios: Iterable[str], seeds: Sequence[int]) -> list[Job]:
    """Return the runs of all arms of these scenarios."""
    criteria = {"collision": {"of": EGO, "name": CONTACT}}
    return [
        Job(f"corner_cases/{name}", arm, seed, RunSettings(parameters=dict(parameters), criteria=criteria))
        for name in scenarios
        for arm, parameters in {ALONE: {"Participants": "none"}, **ARMS[name]}.items()
        for seed in seeds
    ]


def table(runs: Sequence[SceneRun]) -> str:
    """Return the runs as a Markdown table, one line per scenario and arm in order of appearance."""
    titles = ("scenario", "senders", "collisions", "arrived", "known after [s]", "time lost [s]")
    lines = []
    before = ""
    for (scenario, arm), mine in group_by(runs, attrgetter("scenario", "planner")).items():
        free = [run for run in mine if not run.collided]
        cells = (
            "" if scenario == before else f"`{scenario.split('/')[-1]}`",
            arm,
            f"{sum(run.collided for run in mine)} of {len(mine)}",
            f"{sum(run.arrived for run in mine)} of {len(mine)}",
            _mean([run.detected for run in mine if run.detected is not None]),
            _mean([run.lost for run in mine if run.arrived]),
            f"{max(run.braking for run in free):.1f}" if free else "-",
        )
        lines.append(cells)
        before = scenario
    return markdown_table((*titles, "hardest braking [m/s²]"), lines)


def _mean(values: Sequence[float]) -> str:
    return f"{sum(values) / len(values):.1f}".replace("-0.0", "0.0") if values else "-"


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    choices = [*ARMS, []]  # argparse compares an empty list of names with the choices, too
    parser.add_argument("names", nargs="*", choices=choices, help="scenarios (default: all)")
    options = study_options(parser, arguments, seeds=10)
    chosen = jobs(options.names or ARMS, range(1, options.seeds + 1))
    runs = run_jobs(chosen, run_of, workers=options.workers, console=Console(stderr=True), title="corner cases")
    publish(table(runs), options.out / "corner_cases.md")


if __name__ == "__main__":
    sys.exit(main())
