"""Values of the rows of a part for its figures."""

from __future__ import annotations

from eidrive_scenario.experiments.reproduction.layout import Row


def number(row: Row, name: str) -> float:
    """Return a field as number; 0 if it is empty."""
    return float(row[name] or 0.0)


def scenario_title(scenario: str) -> str:
    """Return the name of a scenario of the library as text of a figure."""
    return scenario.removeprefix("coop/").replace("_", " ")
