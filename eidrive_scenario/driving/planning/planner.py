"""Interface of planners (abstract base class `Planner`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from eidrive_scenario.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.planner_settings import PlannerSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.requests import Goal
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState, SignalReading
from eidrive_scenario.settings import parse_settings
from eidrive_scenario.world.actor import ActorSpec


class Planner(ABC):
    """Planner of one station: a trajectory in every tick. Built once for each station and run.

    A class is registered in the entry points `eidrive_scenario.planners`. It is built as
    `cls(settings, spec, roads, dt=…, seed=…)`. Its inputs are those of its station only.
    """

    settings_type: ClassVar[type[PlannerSettings]] = PlannerSettings
    """Type of the settings that the controller may give the planner, each as a property of its name or in the property
    `planner_settings`."""
    planner_settings: PlannerSettings
    view: tuple[ViewSector, ...] | None = None
    """Sectors around the vehicle in which its detector can detect objects; None: in all directions."""
    observes_regions: bool = False
    """Whether the planner uses the perception regions, which are determined only then."""

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        own = settings.planner_settings
        if not isinstance(own, self.settings_type):
            own = parse_settings(self.settings_type, own.model_dump(exclude_unset=True))
        self.settings = settings
        self.planner_settings = own
        self.spec = spec
        self.roads = roads
        self.dt = dt
        self.seed = seed

    def observe_signals(self, signals: Sequence[SignalReading]) -> None:  # noqa: B027 - for planners that know signals
        """Receive the visible traffic lights and stop signs; called before `plan` if the station obeys signals."""

    def observe_regions(self, regions: Sequence[PerceptionRegion]) -> None:  # noqa: B027 - for planners that use them
        """Receive the newest perception region of the own sensors and of each sender of CPMs; called before `plan`."""

    @abstractmethod
    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        """Return the trajectory from the ego pose at `now` [s]. `goal` is the request of the scenario, or None."""
