"""Pipeline scenarios of the paper: overtaking, following, a traffic light and a stop sign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.drives import DRIVE_COLUMNS, drive_fields, failures, tasks
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import DataTable, PartReport, Row, Section, plain
from eidrive_reports.reproduction.part import Case, Part, select
from eidrive_scenario.api.run import RunSettings

OTHERS: Mapping[str, tuple[str, ...]] = {
    "pipeline/scenario_1": ("First", "Second"),
    "pipeline/scenario_2": ("Lead",),
    "pipeline/scenario_3": (),
    "pipeline/scenario_4": (),
}
"""Vehicles from which the ego keeps its distance, by scenario. The paper compares detectors where there are some."""
DETECTORS = ("oracle", "yolov5", "ssd")


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells: the first detector in all scenarios, the others in those with vehicles."""
    return [
        Case(scenario, detector, RunSettings(detector=detector, criteria=_distances(others)))
        for scenario, others in OTHERS.items()
        for detector in detectors
        if others or detector == detectors[0]
    ]


def _distances(others: Sequence[str]) -> list[Mapping[str, Any]]:
    return [{"min_distance": {"of": EGO, "to": other, "name": f"distance_{other}"}} for other in others]


COLUMNS = (
    plain("scenario", "scenario"),
    plain("task", "task"),
    plain("detector", "detector"),
    *DRIVE_COLUMNS,
    plain("least gap [m]", "gap", ".2f"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: completed runs by scenario and detector."""
    rows: list[Row] = [
        {
            "scenario": case.scenario,
            "task": tasks("pipeline")[case.scenario],
            "detector": case.arm,
            **drive_fields(select(episodes, case.scenario, case.arm)),
        }
        for case in cases(detectors)
    ]
    passed, runs = (sum(int(row[name] or 0) for row in rows) for name in ("passed", "episodes"))
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
    sections = (Section("Set-up", (setup,)), Section("Result", (result,), DataTable("pipeline", COLUMNS, tuple(rows))))
    return PartReport(PART.title, sections)


PART = Part(
    "pipeline",
    "Pipeline scenarios",
    "Does the driving stack complete the driving tasks of the paper with each detector?",
    5,
    DETECTORS,
    DETECTORS,
    cases,
    report,
    has_replays=True,
)
