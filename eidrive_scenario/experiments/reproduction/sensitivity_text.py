"""Texts of the report on sensitivity, from its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from eidrive_scenario.experiments.reproduction.layout import Row

ORIGINAL = {"coop/scenario_1": (39.5, 8.0556), "coop/scenario_2": (34.5, 8.3333)}
"""Start of the hidden car [m] and speed of the ego [m/s] in EI-Drive's configuration, by scenario."""
LIBRARY = {"coop/scenario_1": (36.5, 8.0556), "coop/scenario_2": (30.5, 8.3333)}
"""Start and speed of the library's scenarios, with which Table II is repeated."""


def setup(per_cell: int, per_latency: int) -> tuple[str, ...]:
    """Return the paragraphs about the runs."""
    return (
        "Scenarios 1 and 2 with the rule of the paper and a channel that acts on links only. Maps over the start of "
        f"the hidden car and the speed of the ego have {per_cell} episodes a cell, the curves over the latency "
        f"{per_latency} episodes a point. Seeds vary the starts of both cars by ±2 m and their speeds by ±1 "
        "m/s. Their values are equal in all cells, so that arms differ by their messages only.",
        "EI-Drive starts the hidden car at 39.5 m (scenario 1) and 34.5 m (scenario 2). The library starts it at 36.5 "
        "m and 30.5 m, because its cars gain speed differently. Both places are marked on the maps.",
    )


def conclusions(cells: Sequence[Row], effects: Sequence[Row], curve: Sequence[Row]) -> tuple[str, ...]:
    """Return where messages help, do nothing or harm, and at which latency their effect ends."""
    texts = []
    for row in effects:
        if row["arm"] == "none":
            continue
        texts.append(
            f"{_place(row)}, {row['arm']}: fewer collisions than without cooperation in {row['helps']} of "
            f"{row['cells']} cells, as many in {row['nothing']}, more in {row['harms']}"
        )
    near = []
    for scenario in dict.fromkeys(str(row["scenario"]) for row in cells):
        for name, places in (("of EI-Drive", ORIGINAL), ("of the library", LIBRARY)):
            near.append(f"{_short(scenario)}, start {name}: {_at(cells, scenario, *places[scenario])}")
    return (
        f"Cells of the maps. {'; '.join(texts)}.",
        f"Collisions in the cell that is nearest to a start. {'; '.join(near)}.",
        *(_threshold(curve, scenario) for scenario in dict.fromkeys(str(row["scenario"]) for row in curve)),
    )


def _at(cells: Sequence[Row], scenario: str, start: float, speed: float) -> str:
    mine = [row for row in cells if row["scenario"] == scenario]
    nearest = min(mine, key=lambda row: (abs(_number(row, "start") - start), abs(_number(row, "speed") - speed)))
    same = [row for row in mine if (row["start"], row["speed"]) == (nearest["start"], nearest["speed"])]
    counts = ", ".join(f"{row['arm']} {row['collisions']}" for row in same)
    return f"{counts} of {nearest['episodes']} at {nearest['start']:g} m and {nearest['speed']:g} m/s"


def _threshold(curve: Sequence[Row], scenario: str) -> str:
    mine = [row for row in curve if row["scenario"] == scenario]
    first, last = mine[0], mine[-1]
    before, after = max(pairwise(mine), key=lambda pair: _number(pair[1], "share") - _number(pair[0], "share"))
    return (
        f"{_short(scenario)}: {first['share']:.0%} of the runs have a collision without latency, {last['share']:.0%} "
        f"at {last['latency']:g} s; the largest step is from {before['share']:.0%} at {before['latency']:g} s to "
        f"{after['share']:.0%} at {after['latency']:g} s."
    )


def _number(row: Row, name: str) -> float:
    return float(row[name] or 0.0)


def _place(row: Row) -> str:
    return _short(str(row["scenario"]))


def _short(scenario: str) -> str:
    return scenario.removeprefix("coop/").replace("_", " ")
