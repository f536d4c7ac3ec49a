"""EIScenarios of EI-Drive: completed drives with the planner `behavior`, and with one that ignores objects."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from eidrive_reports.reproduction.drives import DRIVE_COLUMNS, drive_fields, failures, tasks
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import DataTable, PartReport, Row, Section, plain
from eidrive_reports.reproduction.part import Case, Part, select
from eidrive_scenario.api.run import RunSettings

PLANNERS = ("behavior", "route")
"""The default planner, and a lane follower, which shows that a scenario demands a reaction."""
DETECTORS = ("oracle",)


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells."""
    return [
        Case(scenario, f"{detector} {planner}", RunSettings(detector=detector, parameters={"Planner": planner}))
        for scenario, detector, planner in product(tasks("ei"), detectors, PLANNERS)
    ]


COLUMNS = (plain("scenario", "scenario"), plain("task", "task"), plain("planner", "planner"), *DRIVE_COLUMNS)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: completed runs by scenario and planner."""
    rows: list[Row] = [
        {
            "scenario": case.scenario,
            "task": tasks("ei")[case.scenario],
            "planner": case.arm.split()[1],
            **drive_fields(select(episodes, case.scenario, case.arm)),
        }
        for case in cases(detectors)
    ]
    setup = (
        f"The {len(tasks('ei'))} EIScenarios of EI-Drive's repository; {rows[0]['episodes']} episodes a cell with "
        "seeds from 1. A run is completed if the ego reaches its goal in time without a collision. Roads are rebuilt "
        "from the positions of the vehicles; poses and speeds are those of EI-Drive. The paper states no numbers for "
        "its 16 EIScenarios, but that a simple lane follower crashes in them: the planner `route`, which ignores "
        "objects."
    )
    sections = (
        Section("Set-up", (setup,)),
        Section("Result", _conclusions(rows), DataTable("ei", COLUMNS, tuple(rows))),
    )
    return PartReport(PART.title, sections)


def _conclusions(rows: Sequence[Row]) -> tuple[str, ...]:
    by_planner = {planner: [row for row in rows if row["planner"] == planner] for planner in PLANNERS}
    default, follower = by_planner.values()
    crashed = sum(int(row["collisions"] or 0) == row["episodes"] for row in follower)
    passed, runs = (sum(int(row[name] or 0) for row in default) for name in ("passed", "episodes"))
    others = failures(default, "scenario")
    return (
        f"The lane follower has a collision in every run of {crashed} of {len(follower)} scenarios (paper: in all).",
        f"`{PLANNERS[0]}` completes {passed} of {runs} drives. Scenarios with other runs: {others}.",
    )


PART = Part(
    "ei",
    "EIScenarios",
    "Does the default planner avoid the collisions in which a lane follower ends?",
    5,
    DETECTORS,
    DETECTORS,
    cases,
    report,
    has_replays=True,
)
