"""The paper's rule: brake while an object is known in the conflict area, and for a while after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec.structs import replace
from pydantic import BeforeValidator, NonNegativeFloat, PositiveFloat

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import point_in_polygon
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planner_settings import PlannerSettings, Polygon
from eidrive_scenario.driving.planning.path import is_on_level, path_heights
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec


def _areas(value: Any) -> Any:
    """Return areas as polygons. Accept [x0, x1, y0, y1], a polygon, or a list of rectangles and polygons."""
    explanation = "an area is [x0, x1, y0, y1], a list of such, or a polygon [[x, y], [x, y], [x, y], …], in meters"
    if not isinstance(value, Sequence) or isinstance(value, str) or not value:
        raise ValueError(explanation)
    if all(isinstance(bound, (int, float)) for bound in value) or all(_is_point(point) for point in value):
        value = [value]
    polygons: list[Polygon] = []
    for area in value:
        if not isinstance(area, Sequence) or isinstance(area, str):
            raise ValueError(explanation)
        if len(area) == 4 and all(isinstance(bound, (int, float)) for bound in area):
            x0, x1, y0, y1 = area
            if x0 >= x1 or y0 >= y1:
                raise ValueError(f"the rectangle {list(area)} is empty: x0 < x1 and y0 < y1 are expected")
            polygons.append(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
        elif len(area) >= 3 and all(_is_point(point) for point in area):
            polygons.append(tuple((point[0], point[1]) for point in area))
        else:
            raise ValueError(explanation)
    return tuple(polygons)


def _is_point(value: Any) -> bool:
    return (
        isinstance(value, (list, tuple)) and len(value) == 2 and all(isinstance(part, (int, float)) for part in value)
    )


_Rectangle = tuple[float, float, float, float]


class ConflictAreaSettings(PlannerSettings):
    """Settings of the planner `conflict_area`.

    conflict_area  polygons in the world frame [m]; a rectangle may be written as [x0, x1, y0, y1]
    conflict_deceleration  deceleration while an object is in an area [m/s²]
    conflict_hold_time     time for which the vehicle brakes after an object was last known in an area [s]
    """

    area_setting: ClassVar[str | None] = "conflict_area"

    conflict_area: Annotated[
        tuple[Polygon, ...], BeforeValidator(_areas, tuple[Polygon | _Rectangle, ...] | Polygon | _Rectangle)
    ]
    conflict_deceleration: PositiveFloat = 5.0
    conflict_hold_time: NonNegativeFloat = 1.05


class ConflictAreaPlanner(RoutePlanner):
    """Follow the route, and brake while an object is in the conflict area.

    The vehicle brakes with `conflict_deceleration` while the center of a known object lies in the area, and for
    `conflict_hold_time` [s] after the last such instant. Objects with an existence probability below `min_existence`
    are ignored, and so are objects on another level than the path, such as below a bridge.

    Source: the cooperative scenarios of EI-Drive, with 35 ticks of 0.03 s after the last detection, brake 0.25 and
    throttle 0; steering continues. The deceleration of that brake is an assumption of this project.
    """

    settings_type: ClassVar[type[PlannerSettings]] = ConflictAreaSettings
    planner_settings: ConflictAreaSettings

    def __init__(
        self, settings: AgentSettings, spec: ActorSpec, roads: RoadNetwork | None, *, dt: float, seed: int
    ) -> None:
        super().__init__(settings, spec, roads, dt=dt, seed=seed)
        self._last_sighting = -math.inf

    def plan(self, ego: EgoState, objects: Detections, goal: Goal | None, now: float) -> Plan:
        plan = super().plan(ego, objects, goal, now)
        braking = self.planner_settings.conflict_deceleration
        assert self._path is not None
        heights = path_heights(self._path, self.roads, float(ego.position[2]))
        inside_area = self._in_areas(objects, self._path.points, heights)
        if inside_area:
            self._last_sighting = now
            reason = f"{objects.classes[inside_area[0]]} in the conflict area"
            return replace(plan, reason=reason, braking=braking, objects=inside_area)
        if now - self._last_sighting < self.planner_settings.conflict_hold_time - TIME_TOLERANCE:
            return replace(plan, reason="an object was in the conflict area", braking=braking)
        return plan

    def _in_areas(self, objects: Detections, path: Array, heights: Array | None) -> tuple[int, ...]:
        """Return the rows of the objects in an area whose existence probability reaches `min_existence`.

        path, heights  (M, 2) and (M,) [m]; objects on another level, such as below a bridge, are in no area
        """
        settings = self.planner_settings
        inside = [
            index
            for index, (x, y) in enumerate(objects.boxes[:, :2].tolist())
            if any([point_in_polygon(x, y, area) for area in settings.conflict_area])
            and objects.confidence[index] >= settings.min_existence
        ]
        if inside and heights is not None:
            bottom = objects.boxes[:, 2] - objects.boxes[:, 5] / 2.0
            points = np.column_stack([objects.boxes[:, :2], bottom])
            inside = [index for index in inside if is_on_level(points[index], path, heights)]
        return tuple(inside)
