"""A car that drives by a planner among given objects, without sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from opendrive_xml import map_xml, road_xml
from signal_street import CAR

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import footprint_distance
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.control.pid_controller import PidController
from eidrive_scenario.driving.planning.behavior.planner import BehaviorPlanner
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement

FRONT = CAR.offset[0] + CAR.size[0] / 2.0
"""Distance of the front of the car from its reference point [m]."""
LANE = -1.75
"""y of the center of the lane of the car [m]."""


class KnownBox(NamedTuple):
    """Object with the center of its box; `deviation` of its position in x and y, or `deviation_y` in y [m]."""

    x: float
    y: float = LANE
    vx: float = 0.0
    vy: float = 0.0
    kind: str = "car"
    size: tuple[float, float] = (4.5, 1.8)
    yaw: float = 0.0
    score: float = 1.0
    deviation: float = 0.1
    deviation_y: float | None = None

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (2, 2) of the position [m²]."""
        return np.diag([self.deviation, self.deviation if self.deviation_y is None else self.deviation_y]) ** 2


def detections(time: float, *objects: KnownBox) -> Detections:
    return Detections(
        time,
        boxes=np.array([(o.x, o.y, 0.75, *o.size, 1.5, o.yaw) for o in objects]).reshape(-1, 7),
        scores=np.array([o.score for o in objects]),
        classes=tuple(o.kind for o in objects),
        velocity=np.array([(o.vx, o.vy) for o in objects]).reshape(-1, 2),
        covariance=np.array([o.covariance for o in objects]).reshape(-1, 2, 2),
    )


def two_lane_road(length: float = 400.0) -> RoadNetwork:
    """Return a straight road along x with a lane of 3.5 m in each direction."""
    return RoadNetwork.parse(map_xml(road_xml(length=length)))


def behavior(roads: RoadNetwork | None, target_speed: float = 10.0, **settings: float | bool) -> BehaviorPlanner:
    own = AgentSettings.model_validate({"target_speed": target_speed, "planner": "behavior"})
    own = own.model_copy(update={"planner_settings": BehaviorSettings.model_validate(settings)})
    return BehaviorPlanner(own, CAR, roads, dt=0.05, seed=0)


class PlannedDrive:
    """Car on the right lane, from x = 20 m by default, in the physics world, controlled by PID along the plans."""

    def __init__(
        self,
        planner: BehaviorPlanner,
        roads: RoadNetwork,
        *,
        speed: float = 10.0,
        start: float = 20.0,
        y: float = LANE,
    ) -> None:
        self.world = World(roads, dt=0.05)
        self.world.add(CAR, Placement(start, y, speed=speed), driven=True)
        self.planner = planner
        self.controller = PidController(CAR, 0.05)
        self.rig = Rig(CAR, {})
        self.plans: list[Plan] = []
        self.path: list[tuple[float, float, float]] = []

    def run(
        self,
        seconds: float,
        objects: Callable[[float], Sequence[KnownBox]],
        *,
        age: float = 0.0,
        goal: Goal = Goal(),  # noqa: B008 - immutable
    ) -> None:
        """Run for a duration [s]; the planner receives the objects as they were `age` seconds before."""
        for _ in range(round(seconds / 0.05)):
            view = self.world.view()
            ego = self.rig.read(self.world, view).ego
            known = detections(view.time - age, *objects(view.time - age))
            plan = self.planner.plan(ego, known, goal, view.time)
            self.plans.append(plan)
            self.path.append((float(view.position[0, 0]), float(view.position[0, 1]), float(view.speed[0])))
            self.world.step({}, {"Ego": self.controller.control(ego, plan)})

    @property
    def reasons(self) -> list[str]:
        """Reasons of all plans."""
        return [plan.reason for plan in self.plans]

    @property
    def front(self) -> float:
        """X of the front of the car [m]."""
        return self.path[-1][0] + FRONT

    @property
    def speeds(self) -> list[float]:
        """Speeds at all ticks [m/s]."""
        return [speed for _, _, speed in self.path]

    def least_distance(self, standing: KnownBox) -> float:
        """Return the least distance between the bodies of the car and of a standing object in plan view [m]."""
        x, y, _ = np.array(self.path).T
        yaw = np.arctan2(np.gradient(y), np.gradient(x))
        center = CAR.offset[0]
        poses = zip(x + center * np.cos(yaw), y + center * np.sin(yaw), yaw, strict=True)
        body = (standing.x, standing.y, 0.0, *standing.size, 1.0, standing.yaw)
        return min(footprint_distance((*pose[:2], 0.0, *CAR.size, pose[2]), body) for pose in poses)

    @property
    def hardest_braking(self) -> float:
        """Maximum deceleration over 0.2 s [m/s²]."""
        speeds = np.array(self.speeds)
        return float((speeds[:-4] - speeds[4:]).max() / 0.2)
