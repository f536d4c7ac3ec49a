"""Encounter of the ego with the occluded car: distances, collisions, speed of impact and time to collision."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from eidrive_reports.paper import EGO, HIDDEN
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import Column, Row, bounds, plain
from eidrive_scenario.api.common import SimulationError
from eidrive_scenario.api.experiments import mean_interval, summarize, wilson

CRITERIA: Mapping[str, Any] = {"time_to_collision": {"of": EGO, "to": HIDDEN}}
"""Criteria that all runs of encounters have in addition to those of the scenario."""
CENTER = f"min_distance.{EGO}.{HIDDEN}.center"
GAP = f"min_distance.{EGO}.{HIDDEN}.box"
TIME_TO_COLLISION = f"time_to_collision.{EGO}.{HIDDEN}"
COLLISIONS, IMPACT_SPEED = "collision.count", "collision.impact_speed"


def metric(episode: Episode, name: str) -> float:
    """Return a metric. Raise SimulationError if the run lacks it."""
    try:
        return episode.metrics[name]
    except KeyError:
        raise SimulationError(
            f"{episode.scenario}, {episode.arm}, seed {episode.seed}: metric {name} is missing "
            "(expected a scenario with the criteria collision and min_distance)"
        ) from None


def centers(episodes: Sequence[Episode]) -> list[float]:
    """Return the minimum distances between the centers, the metric of the paper [m]."""
    return [metric(episode, CENTER) for episode in episodes]


def collided(episode: Episode) -> bool:
    """Return whether the ego touched any body."""
    return metric(episode, COLLISIONS) > 0


def encounter_fields(episodes: Sequence[Episode]) -> Row:
    """Return the measured values of a cell.

    mean, sd, low, high   minimum distance between the centers: mean, population standard deviation, 95 % interval [m];
                          no interval of one episode
    gap, gap_least        mean and minimum of the distance between the bodies, 0 after a contact [m]
    impact_speed          mean relative speed at the first contact of the runs with one [m/s]; None without one
    crash_least           least minimum distance between the centers of the runs with a contact [m]; None without one
    time_to_collision     median of the minimum time to collision [s]; None if most runs have no collision course
    collisions, collision_low, collision_high   number of runs with a contact, and Wilson interval of their share
    """
    distances = centers(episodes)
    interval, summary = mean_interval(distances), summarize(distances)
    gaps = [metric(episode, GAP) for episode in episodes]
    hits = [episode for episode in episodes if collided(episode)]
    speeds = [episode.metrics[IMPACT_SPEED] for episode in hits]
    times = median(episode.metrics.get(TIME_TO_COLLISION, math.inf) for episode in episodes)
    share = wilson(len(hits), len(episodes))
    return {
        "episodes": len(episodes),
        "mean": interval.mean,
        "sd": summary.population_sd,
        **bounds(interval),
        "gap": sum(gaps) / len(gaps),
        "gap_least": min(gaps),
        "impact_speed": sum(speeds) / len(speeds) if speeds else None,
        "crash_least": min(centers(hits)) if hits else None,
        "time_to_collision": times if math.isfinite(times) else None,
        "collisions": len(hits),
        "collision_low": share.low,
        "collision_high": share.high,
    }


DISTANCE_COLUMNS = (
    Column("centers [m]", "{mean:.2f} ± {sd:.2f}"),
    Column("95 %", "{low:.2f} to {high:.2f}"),
)
"""Columns of the paper's metric."""
GAP_COLUMNS = (
    Column("gap [m]", "{gap:.2f}, least {gap_least:.2f}"),
    plain("impact [m/s]", "impact_speed", ".1f"),
    plain("time to collision [s]", "time_to_collision", ".2f"),
)
"""Columns that the paper lacks."""
