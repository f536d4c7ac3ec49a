"""Fusion of the reports of all stations in one tick."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.step import StationPerception
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.registry import is_built_in


def fuse_reports(
    agents: Mapping[str, Agent], sensed: Mapping[str, StationPerception], now: float
) -> dict[str, StationPerception]:
    """Return what each station perceives with the objects after fusion.

    Built-in methods of one class process the reports of all their stations as one batch.
    """
    batches: dict[type[FusionMethod], list[str]] = {}
    perceived = dict(sensed)
    for name, agent in agents.items():
        kind = type(agent.fusion)
        if is_built_in(kind):
            batches.setdefault(kind, []).append(name)
        else:
            perceived[name] = agent.fuse(sensed[name])
    for kind, names in batches.items():
        fused = kind.fuse_batch([agents[name].fusion for name in names], [agents[name].reports for name in names], now)
        for name, objects in zip(names, fused, strict=True):
            perceived[name] = agents[name].with_fused(sensed[name], objects)
    return perceived
