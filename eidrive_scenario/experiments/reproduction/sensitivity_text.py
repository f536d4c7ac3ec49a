"""Texts of the report on sensitivity, from its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from eidrive_scenario.experiments.reproduction.layout import Row
from eidrive_scenario.experiments.reproduction.rows import distinct, number, scenario_title

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
    for planner in dict.fromkeys(str(row["planner"]) for row in cells):
        some, effect, line = ([row for row in rows if row["planner"] == planner] for rows in (cells, effects, curve))
        texts += [f"`{planner}`. {_effects(effect)}", f"`{planner}`. {_places(some)}"]
        texts += [f"`{planner}`, {_threshold(line, scenario)}" for scenario in distinct(line, "scenario")]
    return tuple(texts)


def _effects(effects: Sequence[Row]) -> str:
    listed = [
        f"{scenario_title(str(row['scenario']))}, {row['arm']}: {row['helps']}, {row['nothing']} and {row['harms']} of "
        f"{row['cells']}"
        for row in effects
        if row["arm"] != "none"
    ]
    return f"Cells with fewer, as many and more collisions than without cooperation. {'; '.join(listed)}."


def _places(cells: Sequence[Row]) -> str:
    near = [
        f"{scenario_title(scenario)}, start {name}: {_at(cells, scenario, *places[scenario])}"
        for scenario in distinct(cells, "scenario")
        for name, places in (("of EI-Drive", ORIGINAL), ("of the library", LIBRARY))
    ]
    return f"Collisions in the cell that is nearest to a start. {'; '.join(near)}."


def _at(cells: Sequence[Row], scenario: str, start: float, speed: float) -> str:
    mine = [row for row in cells if row["scenario"] == scenario]
    nearest = min(mine, key=lambda row: (abs(number(row, "start") - start), abs(number(row, "speed") - speed)))
    same = [row for row in mine if (row["start"], row["speed"]) == (nearest["start"], nearest["speed"])]
    counts = ", ".join(f"{row['arm']} {row['collisions']}" for row in same)
    return f"{counts} of {nearest['episodes']} at {nearest['start']:g} m and {nearest['speed']:g} m/s"


def _threshold(curve: Sequence[Row], scenario: str) -> str:
    mine = [row for row in curve if row["scenario"] == scenario]
    first, last = mine[0], mine[-1]
    before, after = max(pairwise(mine), key=lambda pair: number(pair[1], "share") - number(pair[0], "share"))
    ends = (
        f"{scenario_title(scenario)}: {first['share']:.0%} of the runs have a collision without latency, "
        f"{last['share']:.0%} at {last['latency']:g} s"
    )
    if number(after, "share") <= number(before, "share"):
        return f"{ends}; the share nowhere increases."
    step = f"{before['share']:.0%} at {before['latency']:g} s to {after['share']:.0%} at {after['latency']:g} s"
    return f"{ends}; the largest step is from {step}."
