"""Sensitivity of scenarios 1 and 2, which the paper lacks: collisions over start, speed and latency.

The start of the hidden car and the speed of the ego span a map per arm. Seeds differ as traffic does, by ±2 m and
±1 m/s, so that each cell of a map has a probability of a collision. A curve over the latency is measured at the values
of the library.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
from typing import Any

from eidrive_reports.paper import SCENARIOS
from eidrive_reports.reproduction.encounters import collided
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import (
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    bounds,
    groups,
    plain,
    scenario_title,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, by_case, seed_of_block
from eidrive_scenario.api.common import generator
from eidrive_scenario.api.experiments import wilson
from eidrive_scenario.api.run import RunSettings

ORIGINAL = {"coop/scenario_1": (39.5, 8.0556), "coop/scenario_2": (34.5, 8.3333)}
"""Start of the hidden car [m] and speed of the ego [m/s] in EI-Drive's configuration, by scenario."""
LIBRARY = {"coop/scenario_1": (36.5, 8.0556), "coop/scenario_2": (30.5, 8.3333)}
"""Start and speed of the library's scenarios, with which Table II is repeated."""


def setup(per_cell: int, per_latency: int) -> tuple[str, ...]:
    """Return the paragraphs about the runs."""
    return (
        "Scenarios 1 and 2 with a channel that acts on links only, and with two planners: the rule of the paper "
        "(`conflict_area`) and the default planner `behavior`. Maps over the start of "
        f"the hidden car and the speed of the ego have {per_cell} episodes a cell, the curves over the latency "
        f"{per_latency} episodes a point. Seeds vary the starts of both cars by ±2 m and their speeds by ±1 "
        "m/s. Their values are equal in all cells, so that arms differ by their messages only.",
        "EI-Drive starts the hidden car at 39.5 m (scenario 1) and 34.5 m (scenario 2). The library starts it at 36.5 "
        "m and 30.5 m, because its cars gain speed differently. Both places are marked on the maps.",
    )


def conclusions(cells: Sequence[Row], effects: Sequence[Row], curve: Sequence[Row]) -> tuple[str, ...]:
    """Return per planner where messages help, do nothing or harm, and at which latency their effect ends."""
    texts = []
    for planner, some in groups(cells, "planner").items():
        effect, line = (where(rows, planner=planner) for rows in (effects, curve))
        texts += [f"`{planner}`. {_effects(effect)}", f"`{planner}`. {_collisions_near_starts(some)}"]
        texts += [f"`{planner}`, {_threshold(scenario, mine)}" for scenario, mine in groups(line, "scenario").items()]
    return tuple(texts)


def _effects(effects: Sequence[Row]) -> str:
    listed = [
        f"{scenario_title(row['scenario'])}, {row['arm']}: {row['helps']}, {row['nothing']} and {row['harms']} of "
        f"{row['cells']}"
        for row in effects
        if row["arm"] != "none"
    ]
    return f"Cells with fewer, as many and more collisions than without cooperation. {'; '.join(listed)}."


def _collisions_near_starts(cells: Sequence[Row]) -> str:
    near = [
        f"{scenario_title(scenario)}, start {name}: {_at(mine, *places[scenario])}"
        for scenario, mine in groups(cells, "scenario").items()
        for name, places in (("of EI-Drive", ORIGINAL), ("of the library", LIBRARY))
    ]
    return f"Collisions in the cell that is nearest to a start. {'; '.join(near)}."


def _at(cells: Sequence[Row], start: float, speed: float) -> str:
    nearest = min(cells, key=lambda row: (abs(row["start"] - start), abs(row["speed"] - speed)))
    same = where(cells, start=nearest["start"], speed=nearest["speed"])
    counts = ", ".join(f"{row['arm']} {row['collisions']}" for row in same)
    return f"{counts} of {nearest['episodes']} at {nearest['start']:g} m and {nearest['speed']:g} m/s"


def _threshold(scenario: str, curve: Sequence[Row]) -> str:
    first, last = curve[0], curve[-1]
    before, after = max(pairwise(curve), key=lambda pair: pair[1]["share"] - pair[0]["share"])
    ends = (
        f"{scenario_title(scenario)}: {first['share']:.0%} of the runs have a collision without latency, "
        f"{last['share']:.0%} at {last['latency']:g} s"
    )
    if after["share"] <= before["share"]:
        return f"{ends}; the share nowhere increases."
    step = f"{before['share']:.0%} at {before['latency']:g} s to {after['share']:.0%} at {after['latency']:g} s"
    return f"{ends}; the largest step is from {step}."


STARTS: Mapping[str, tuple[float, ...]] = {
    "coop/scenario_1": (33.0, 34.5, 36.0, 37.5, 39.0, 40.5, 42.0),
    "coop/scenario_2": (27.0, 28.5, 30.0, 31.5, 33.0, 34.5, 36.0),
}
"""Starts of the hidden car on the maps, its distance from the path of the ego along y [m]."""
SPEEDS = (6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0)
"""Speeds of the ego on the maps [m/s]."""
LATENCIES = tuple(round(0.05 * step, 2) for step in range(13))
"""Latencies of the curve [s]."""
CURVE_SEEDS = 4
"""Number of runs of the curve per episode of a map."""
OFFSETS = {"EgoOffset": 2.0, "IncomingOffset": 2.0, "EgoSpeedOffset": 1.0, "IncomingSpeedOffset": 1.0}
"""Maximum offset between seeds by parameter [m, m/s]."""
DURATION = 9.0
"""End of an episode [s]; at the lowest speed the cars are nearest at 6 s."""
PLANNERS = ("conflict_area", "behavior")
"""The rule of the paper, and the default planner of this project."""
DETECTORS = ("oracle",)


def delay(seconds: float) -> Mapping[str, Any]:
    """Return the channel profile of a constant latency on links."""
    return {"model": "composed", "delay": {"kind": "constant", "seconds": seconds}}


ARMS: Mapping[str, str | Mapping[str, Any]] = {
    "none": "none",
    "cooperation": "ideal",
    "latency 0.1 s": delay(0.1),
    "latency 0.3 s": delay(0.3),
    "latency 0.6 s": delay(0.6),
    "error 30 %": "error_30pct",
}
"""Channel of each arm of the maps; it acts on links only."""


def offsets(seed: int) -> dict[str, str]:
    """Return the offsets of a seed as parameters: uniform, independent, and equal in all cells."""
    random = generator(seed, "sensitivity")
    return {name: repr(float(random.uniform(-bound, bound))) for name, bound in OFFSETS.items()}


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of the maps and of the curves."""
    runs = []
    for stack, scenario in product(product(detectors, PLANNERS), SCENARIOS):
        for start, speed, (arm, channel) in product(STARTS[scenario], SPEEDS, ARMS.items()):
            parameters = {"IncomingStart": repr(start), "EgoSpeed": repr(speed)}
            runs.append(_case(scenario, stack, f"map {start} {speed} {arm}", channel, parameters))
        for latency, block in product(LATENCIES, range(CURVE_SEEDS)):
            runs.append(_case(scenario, stack, f"curve {latency} {block}", delay(latency), {}, block=block))
    return runs


def _case(
    scenario: str,
    stack: tuple[str, str],
    label: str,
    channel: str | Mapping[str, Any],
    parameters: Mapping[str, str],
    block: int = 0,
) -> Case:
    """Return a case whose seeds have own offsets; those of different blocks differ. `stack`: detector and planner."""
    detector, planner = stack
    settings = RunSettings(
        detector=detector, planner=planner, channel=channel, parameters=parameters, time_limit=DURATION
    )

    def varied(seed: int) -> dict[str, str]:
        return offsets(seed_of_block(seed, block, CURVE_SEEDS))

    return Case(scenario, f"{detector} {planner} {label}", settings, varied=varied)


def map_rows(episodes: Sequence[Episode], detectors: Sequence[str]) -> Iterator[Row]:
    """Yield the collisions of each cell of the maps."""
    runs = by_case(episodes)
    for detector, planner, scenario, arm in product(detectors, PLANNERS, SCENARIOS, ARMS):
        for start, speed in product(STARTS[scenario], SPEEDS):
            mine = runs[scenario, f"{detector} {planner} map {start} {speed} {arm}"]
            hits = sum(map(collided, mine))
            key = {"scenario": scenario, "detector": detector, "planner": planner, "arm": arm}
            yield {**key, "start": start, "speed": speed, "episodes": len(mine), "collisions": hits}


def curve_rows(episodes: Sequence[Episode], detectors: Sequence[str]) -> Iterator[Row]:
    """Yield the collisions over the latency."""
    runs = by_case(episodes)
    for detector, planner, scenario, latency in product(detectors, PLANNERS, SCENARIOS, LATENCIES):
        names = [f"{detector} {planner} curve {latency} {block}" for block in range(CURVE_SEEDS)]
        mine = [episode for name in names for episode in runs[scenario, name]]
        share = wilson(sum(map(collided, mine)), len(mine))
        yield {
            "scenario": scenario,
            "detector": detector,
            "planner": planner,
            "latency": latency,
            "episodes": len(mine),
            "collisions": share.successes,
            "share": share.share,
            **bounds(share),
        }


def effects(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield for each arm with messages in how many cells of its map they help, change nothing, or harm.

    A cell counts by the number of collisions, with the same seeds as without cooperation.
    """
    maps = groups(rows, "detector", "planner", "scenario", "arm")
    for (*stack, arm), mine in maps.items():
        alone = maps[*stack, "none"]  # has its cells in the same order
        changes = [row["collisions"] - other["collisions"] for row, other in zip(mine, alone, strict=True)]
        yield {
            **dict(zip(("detector", "planner", "scenario"), stack, strict=True)),
            "arm": arm,
            "cells": len(mine),
            "episodes": sum(row["episodes"] for row in mine),
            "collisions": sum(row["collisions"] for row in mine),
            "helps": sum(change < 0 for change in changes),
            "nothing": sum(change == 0 for change in changes),
            "harms": sum(change > 0 for change in changes),
        }


EFFECT_COLUMNS = (
    *map(plain, ("planner", "scenario", "arm")),
    Column("collisions", "{collisions} of {episodes}"),
    Column("cells with fewer than without cooperation", "{helps} of {cells}"),
    plain("as many", "nothing"),
    plain("more", "harms"),
)
CURVE_COLUMNS = (
    *map(plain, ("planner", "scenario")),
    plain("latency [s]", "latency", ".2f"),
    Column("collisions", "{collisions} of {episodes}"),
    Column("95 %", "{low:.0%} to {high:.0%}"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: where cooperation helps, does nothing or harms, and the curves over the latency."""
    cells = tuple(map_rows(episodes, detectors))
    summary, curve = tuple(effects(cells)), tuple(curve_rows(episodes, detectors))
    table = DataTable("sensitivity_effects", EFFECT_COLUMNS, summary)
    sections = (
        Section("Set-up", setup(cells[0]["episodes"], curve[0]["episodes"])),
        Section("Result", conclusions(cells, summary, curve), table),
        Section("Latency", (), DataTable("sensitivity_latency", CURVE_COLUMNS, curve)),
        Section("Maps", ("All cells: sensitivity.csv.",), DataTable("sensitivity", (), cells)),
    )
    return PartReport(PART.title, sections)


PART = Part(
    "sensitivity",
    "Sensitivity of scenarios 1 and 2",
    (
        "Where in the space of starts, speeds and latencies does cooperation avoid collisions, change "
        "nothing, or cause them, and where are the cells of Table II?"
    ),
    3,
    DETECTORS,
    cases,
    report,
)
