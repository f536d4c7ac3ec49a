"""Drives of the ego to a goal, which the criteria of the scenario judge: the pipeline scenarios and the EIScenarios."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product

from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.encounters import COLLISIONS
from eidrive_reports.reproduction.episodes import Episode, gaps
from eidrive_reports.reproduction.layout import (
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    bounds,
    groups,
    plain,
)
from eidrive_reports.reproduction.part import Case, Part, by_case
from eidrive_scenario.api.experiments import describe_scenarios, summarize, wilson
from eidrive_scenario.api.run import RunSettings


@cache
def tasks(family: str) -> dict[str, str]:
    """Return the task of each scenario of a family, from the description in its header."""
    return {
        entry.name: entry.description.partition(": ")[2] or entry.description
        for entry in describe_scenarios()
        if entry.family == family
    }


def drive_fields(episodes: Sequence[Episode]) -> Row:
    """Return the measured values of a cell.

    passed, low, high  number of runs that meet all criteria, and Wilson interval of their share
    failed             criteria that failed, with the number of runs; "" if all runs pass
    collisions         number of runs in which the ego touches anything
    duration           mean duration of the runs that pass [s]; None without one
    gap                minimum distance between the bodies of the ego and the named others [m]; None without a criterion
    """
    good = [episode for episode in episodes if not episode.failed]
    failed = Counter(name for episode in episodes for name in episode.failed)
    return {
        "episodes": len(episodes),
        "passed": len(good),
        **bounds(wilson(len(good), len(episodes))),
        "failed": ", ".join(f"{name} {count}" for name, count in sorted(failed.items())),
        "collisions": sum(episode.metrics.get(COLLISIONS, 0.0) > 0.0 for episode in episodes),
        "duration": summarize([episode.simulated_s for episode in good]).mean if good else None,
        "gap": min((distance for episode in episodes for distance in gaps(episode)), default=None),
    }


DRIVE_COLUMNS = (
    Column("completed", "{passed} of {episodes}"),
    Column("95 %", "{low:.0%} to {high:.0%}"),
    plain("collisions"),
    plain("duration [s]", "duration", ".1f"),
)


def failures(rows: Sequence[Row], *names: str) -> str:
    """Return the rows in which runs fail, identified by fields, with their criteria; `none` if there are none."""
    listed = [
        f"{' '.join(row[name] for name in names)} ({row['episodes']} runs: {row['failed']})"
        for row in rows
        if row["failed"]
    ]
    return "; ".join(listed) if listed else "none"


OTHERS: Mapping[str, tuple[str, ...]] = {
    "pipeline/scenario_1": ("First", "Second"),
    "pipeline/scenario_2": ("Lead",),
    "pipeline/scenario_3": (),
    "pipeline/scenario_4": (),
}
"""Vehicles from which the ego keeps its distance, by scenario. The paper compares detectors where there are some."""
DETECTORS = ("oracle", "yolov5", "ssd")


def pipeline_cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells: the first detector in all scenarios, the others in those with vehicles."""
    return [
        Case(
            scenario,
            detector,
            RunSettings(
                detector=detector,
                criteria=[{"min_distance": {"of": EGO, "to": other, "name": f"distance_{other}"}} for other in others],
            ),
        )
        for scenario, others in OTHERS.items()
        for detector in detectors
        if others or detector == detectors[0]
    ]


PIPELINE_COLUMNS = (
    *map(plain, ("scenario", "task", "detector")),
    *DRIVE_COLUMNS,
    plain("least gap [m]", "gap", ".2f"),
)


def pipeline_report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: completed runs by scenario and detector."""
    rows: list[Row] = [
        {"scenario": scenario, "task": tasks("pipeline")[scenario], "detector": detector, **drive_fields(mine)}
        for (scenario, detector), mine in by_case(episodes).items()
    ]
    passed, runs = (sum(row[name] for row in rows) for name in ("passed", "episodes"))
    setup = (
        f"{rows[0]['episodes']} episodes a cell with seeds from 1, which vary starts by ±0.15 m and speeds by "
        "±0.1 m/s. A run is completed if the ego reaches its goal in time without a collision, a red light or a stop "
        "sign run. Positions and speeds are those of EI-Drive; the planner is `behavior`. The paper shows pictures of "
        "one run of each scenario in which the ego completes its task, and of three detectors in the first two."
    )
    result = (
        f"{passed} of {runs} runs complete the task (paper: every run that it shows). Cells with other runs: "
        f"{failures(rows, 'scenario', 'detector')}."
    )
    table = DataTable("pipeline", PIPELINE_COLUMNS, tuple(rows))
    return PartReport(PIPELINE.title, (Section("Set-up", (setup,)), Section("Result", (result,), table)))


PIPELINE = Part(
    "pipeline",
    "Pipeline scenarios",
    "Does the driving stack complete the driving tasks of the paper with each detector?",
    5,
    DETECTORS,
    pipeline_cases,
    pipeline_report,
    has_replays=True,
)


PLANNERS = ("behavior", "route")
"""The default planner, and a lane follower, which shows that a scenario demands a reaction."""


def ei_cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells of the EIScenarios."""
    return [
        Case(scenario, f"{detector} {planner}", RunSettings(detector=detector, parameters={"Planner": planner}))
        for scenario, detector, planner in product(tasks("ei"), detectors, PLANNERS)
    ]


EI_COLUMNS = (plain("scenario"), plain("task"), plain("planner"), *DRIVE_COLUMNS)


def ei_report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: completed runs by scenario and planner."""
    rows: list[Row] = [
        {"scenario": scenario, "task": tasks("ei")[scenario], "planner": arm.split()[1], **drive_fields(mine)}
        for (scenario, arm), mine in by_case(episodes).items()
    ]
    setup = (
        f"The {len(tasks('ei'))} EIScenarios of EI-Drive's repository; {rows[0]['episodes']} episodes a cell with "
        "seeds from 1. A run is completed if the ego reaches its goal in time without a collision. Roads are rebuilt "
        "from the positions of the vehicles; poses and speeds are those of EI-Drive. The paper states no numbers for "
        "its 16 EIScenarios, but that a simple lane follower crashes in them: the planner `route`, which ignores "
        "objects."
    )
    default, follower = (groups(rows, "planner")[planner] for planner in PLANNERS)
    crashed = sum(row["collisions"] == row["episodes"] for row in follower)
    passed, runs = (sum(row[name] for row in default) for name in ("passed", "episodes"))
    results = (
        f"The lane follower has a collision in every run of {crashed} of {len(follower)} scenarios (paper: in all).",
        f"`{PLANNERS[0]}` completes {passed} of {runs} drives. Scenarios with other runs: "
        f"{failures(default, 'scenario')}.",
    )
    table = DataTable("ei", EI_COLUMNS, tuple(rows))
    return PartReport(EI.title, (Section("Set-up", (setup,)), Section("Result", results, table)))


EI = Part(
    "ei",
    "EIScenarios",
    "Does the default planner avoid the collisions in which a lane follower ends?",
    5,
    ("oracle",),
    ei_cases,
    ei_report,
    has_replays=True,
)
