"""Values of the rows of a part, for its texts and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from eidrive_scenario.experiments.reproduction.layout import Row


def number(row: Row, name: str) -> float:
    """Return a field as number; 0 if it is empty."""
    return float(row[name] or 0.0)


def finite(value: float) -> float | None:
    """Return a number, or None for NaN: an undefined value is an empty field."""
    return None if math.isnan(value) else value


def limits(rows: Sequence[Row], name: str, low: str = "low", high: str = "high") -> tuple[list[float], list[float]]:
    """Return the limits of the intervals of a field; the value itself where there is none."""
    ends = [[number(row, name if row[end] is None else end) for row in rows] for end in (low, high)]
    return ends[0], ends[1]


def distinct(rows: Sequence[Row], name: str) -> list[str]:
    """Return the values of a field as texts, in the order of their first rows."""
    return list(dict.fromkeys(str(row[name]) for row in rows))


def scenario_title(scenario: str) -> str:
    """Return the name of a scenario of the library as text."""
    return scenario.removeprefix("coop/").replace("_", " ")
