"""Batches of the detectors of all stations in one tick."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.registry import is_built_in
from eidrive_scenario.sensing.readings import Readings


def prepare_detectors(agents: Mapping[str, Agent], readings: Mapping[str, Readings]) -> None:
    """Let built-in detectors that process batches prepare the readings of all their stations at once."""
    batches: dict[type[Detector], list[str]] = {}
    for name, agent in agents.items():
        detector = agent.perception.detector
        if detector.processes_batches and is_built_in(type(detector)):
            batches.setdefault(type(detector), []).append(name)
    for kind, names in batches.items():
        kind.prepare_batch([agents[name].perception.detector for name in names], [readings[name] for name in names])
