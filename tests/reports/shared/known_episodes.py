"""Episodes of the reproduction with known metrics."""

from __future__ import annotations

from eidrive_reports.reproduction.episodes import Episode


def episode(scenario: str = "coop/scenario_1", arm: str = "arm", seed: int = 1, **metrics: float) -> Episode:
    named = {"center": "min_distance.Ego.Incoming.center", "box": "min_distance.Ego.Incoming.box"}
    values = {named.get(name, name): value for name, value in metrics.items()}
    return Episode(scenario, arm, seed, "0" * 16, "", 10.0, 0.5, {"collision.count": 0.0, **values})
