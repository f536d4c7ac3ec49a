"""The paper's rule: brake while an object is known in the conflict area, and for a while after."""

from __future__ import annotations

import math

from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings, Polygon
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.records import replaced
from eidrive_scenario.requests import Goal
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.world.actor import ActorSpec


class ConflictAreaPlanner(RoutePlanner):
    """Follow the route, and brake while an object is in the conflict area.

    The vehicle brakes with `conflict_deceleration` while the center of a known object lies in the area, and for
    `conflict_hold_time` [s] after the last such instant. Objects with an existence probability below `min_existence`
    are ignored.

    The rule of EI-Drive's cooperative scenarios: 35 ticks of 0.03 s from the last sighting on, brake 0.25, throttle 0,
    the steering goes on. Which deceleration that brake gives is our choice.
    """

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        super().__init__(settings, spec, roads, dt=dt, seed=seed)
        if not settings.conflict_area:
            raise SettingError(Diagnostic("planner 'conflict_area' has no area", "add the property 'conflict_area'"))
        self.areas = settings.conflict_area
        self._last_sighting = -math.inf

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        plan = super().plan(ego, objects, goal, now)
        inside_area = self._in_areas(objects) if len(objects) else ()
        if inside_area:
            self._last_sighting = now
            reason = f"{objects.classes[inside_area[0]]} in the conflict area"
            return replaced(plan, reason=reason, braking=self.settings.conflict_deceleration, objects=inside_area)
        if now - self._last_sighting < self.settings.conflict_hold_time - TIME_TOLERANCE:
            return replaced(
                plan, reason="an object was in the conflict area", braking=self.settings.conflict_deceleration
            )
        return plan

    def _in_areas(self, objects: Detections) -> tuple[int, ...]:
        """The rows of the objects in an area that exist with enough probability."""
        found = [
            index
            for index, (x, y) in enumerate(objects.boxes[:, :2].tolist())
            if any([inside(x, y, area) for area in self.areas])
        ]
        if not found:
            return ()
        existence = objects.confidence.tolist()
        return tuple([index for index in found if existence[index] >= self.settings.min_existence])


def inside(x: float, y: float, polygon: Polygon) -> bool:
    """Whether a point lies inside a polygon, by the even-odd rule."""
    found = False
    x0, y0 = polygon[-1]
    for x1, y1 in polygon:
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            found = not found
        x0, y0 = x1, y1
    return found
