"""The seam of planning: a Planner turns what a station knows into a trajectory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.requests import Goal
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState, SignalReading
from eidrive_scenario.world.actor import ActorSpec


class Planner(ABC):
    """Built anew for each station and run, and asked in every tick. It knows what its station knows, nothing else."""

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        self.settings = settings
        self.spec = spec
        self.roads = roads
        self.dt = dt
        self.seed = seed

    def observe_signals(self, signals: Sequence[SignalReading]) -> None:  # noqa: B027 - for planners that know signals
        """The traffic lights and stop signs in sight now; called before `plan` where the station obeys them."""

    @abstractmethod
    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        """Where to go from here, and how fast."""
