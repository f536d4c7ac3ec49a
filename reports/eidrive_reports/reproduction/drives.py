"""Drives of the ego to a goal, which the criteria of the scenario judge: the pipeline scenarios and the EIScenarios."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache

from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import Column, Row, Value, plain
from eidrive_scenario.api.experiments import describe_scenarios, summarize, wilson

COLLISIONS = "collision.count"


@cache
def tasks(family: str) -> dict[str, str]:
    """Return the task of each scenario of a family, from the description in its header."""
    return {
        entry.name: entry.description.partition(": ")[2] or entry.description
        for entry in describe_scenarios()
        if entry.family == family
    }


def drive_fields(episodes: Sequence[Episode]) -> dict[str, Value]:
    """Return the measured values of a cell.

    passed, low, high  number of runs that meet all criteria, and Wilson interval of their share
    failed             criteria that failed, with the number of runs; "" if all runs pass
    collisions         number of runs in which the ego touches anything
    duration           mean duration of the runs that pass [s]; None without one
    gap                minimum distance between the bodies of the ego and the named others [m]; None without a criterion
    """
    good = [episode for episode in episodes if not episode.failed]
    share = wilson(len(good), len(episodes))
    failed = Counter(name for episode in episodes for name in episode.failed)
    gaps = [
        value
        for episode in episodes
        for name, value in episode.metrics.items()
        if name.startswith("min_distance.") and name.endswith(".box")
    ]
    return {
        "episodes": len(episodes),
        "passed": len(good),
        "low": share.low,
        "high": share.high,
        "failed": ", ".join(f"{name} {count}" for name, count in sorted(failed.items())),
        "collisions": sum(episode.metrics.get(COLLISIONS, 0.0) > 0.0 for episode in episodes),
        "duration": summarize([episode.simulated_s for episode in good]).mean if good else None,
        "gap": min(gaps) if gaps else None,
    }


DRIVE_COLUMNS = (
    Column("completed", "{passed} of {episodes}", ("passed", "episodes")),
    Column("95 %", "{low:.0%} to {high:.0%}", ("low", "high")),
    plain("collisions", "collisions"),
    plain("duration [s]", "duration", ".1f"),
)


def failures(rows: Sequence[Row], *names: str) -> str:
    """Return the rows in which runs fail, identified by fields, with their criteria; `none` if there are none."""
    listed = [
        f"{' '.join(str(row[name]) for name in names)} ({row['episodes']} runs: {row['failed']})"
        for row in rows
        if row["failed"]
    ]
    return "; ".join(listed) if listed else "none"
