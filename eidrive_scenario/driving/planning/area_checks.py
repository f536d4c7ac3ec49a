"""Check of the areas of planners that lie outside the road."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from eidrive_scenario.driving.planner_settings import Polygon
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.geometry import point_in_polygon
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.conventions import is_agent_controller, property_entries
from eidrive_scenario.roads import RoadNetwork

MARGIN = 2.0
"""Maximum distance from the outermost lane that counts as on the road [m], for bays and verges."""
_CELLS = 12
"""Number of sample cells along each side of an area."""


def areas_off_road(
    scenario: Scenario, settings: Mapping[str, AgentSettings], roads: RoadNetwork | None
) -> Iterator[Diagnostic]:
    """Yield a warning for each area of a planner of which no part is on a road."""
    if roads is None:
        return
    for name, station in settings.items():
        planner = station.planner_settings
        setting = planner.area_setting or ""
        for number, area in enumerate(planner.areas, 1):
            gap = distance_to_road(area, roads)
            if gap > MARGIN:
                what = setting.replace("_", " ")
                which = f"the {what}" if len(planner.areas) == 1 else f"{what} {number}"
                source, line = _place(scenario, name, setting)
                yield Diagnostic(
                    f"{which} of {name!r} never holds a vehicle on a road: it lies {gap:.0f} m off the nearest one",
                    "give world coordinates [m] in the frame of the road network: [x0, x1, y0, y1]",
                    source,
                    line,
                )


def distance_to_road(area: Polygon, roads: RoadNetwork) -> float:
    """Return a lower bound of the distance between an area and the outermost lanes [m]; 0 if they may overlap."""
    low = [min(point[axis] for point in area) for axis in (0, 1)]
    step = [(max(point[axis] for point in area) - low[axis]) / _CELLS for axis in (0, 1)]
    centers = [
        (low[0] + (i + 0.5) * step[0], low[1] + (j + 0.5) * step[1]) for i in range(_CELLS) for j in range(_CELLS)
    ]
    points = [*area, *(center for center in centers if point_in_polygon(*center, area))]
    reach = math.hypot(*step) / 2.0
    x, y = np.array(points, dtype=float).T
    nearest = float(roads.locate(x, y, reach=np.inf).outside.min())
    return max(0.0, nearest - reach)


def _place(scenario: Scenario, name: str, setting: str) -> tuple[str, int]:
    """Return file and line of the property with the areas of a station."""
    for controller in filter(is_agent_controller, scenario.controllers.get(name, ())):
        for entry in property_entries(controller):
            if entry.name in (setting, "planner_settings"):
                return controller.source, entry.line
        return controller.source, controller.line
    return "", 0
