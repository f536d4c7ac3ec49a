"""GeoPosition: places on the globe, by the road network's geoReference."""

from __future__ import annotations

import math

from eidrive_scenario.errors import Diagnostic, InputError, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.orientations import oriented
from eidrive_scenario.storyboard.positions.position_errors import roads_of

FAR = 1e4
"""Above and below all roads [m]."""
APART = 0.5
"""Roads whose surfaces differ by less are on one level [m]."""


def geo_position(frame: model.GeoPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a GeoPosition by the road network's projection.

    Relative angles, and missing ones, refer to the lane there.
    """
    roads = roads_of(frame, context)
    x, y = plane_coordinates(frame, roads, context)
    height = frame.altitude if frame.altitude is not None else frame.height
    z = height_of_level(frame, roads, x, y) if height is None else height - roads.header.offset[2]
    here = roads.locate_at(x, y, z=z)
    base = roads.pose(here) if here is not None else Pose(x, y, 0.0, 0.0, 0.0, 0.0)
    return ResolvedPosition(oriented(frame.orientation, base._replace(x=x, y=y, z=base.z if z is None else z)), here)


def plane_coordinates(frame: model.GeoPosition, roads: RoadNetwork, context: ConditionContext) -> tuple[float, float]:
    """x and y [m] of a GeoPosition. Raises ScenarioError if the road network does not say where it lies."""
    latitude, longitude = _angles(frame, context)
    try:
        return roads.geographic(latitude, longitude)
    except InputError as error:
        reason = error.diagnostics[0]
        told = Diagnostic(f"GeoPosition has no place: {reason.message}", reason.hint, frame.source, frame.line)
        raise ScenarioError(told) from error


def height_of_level(frame: model.GeoPosition, roads: RoadNetwork, x: float, y: float) -> float | None:
    """z of the road that verticalRoadSelection means, counted from the lowest, 0 [m]; None where no road is.

    Raises ScenarioError for a level that is not there.
    """
    low, high = (_surface(roads, x, y, end) for end in (-FAR, FAR))
    if low is None or high is None:
        return None
    levels = [low]
    for step in range(1, math.ceil((high - low) / APART) + 1):
        found = _surface(roads, x, y, low + step * APART)
        if found is not None and found > levels[-1] + APART:
            levels.append(found)
    wanted = frame.vertical_road_selection or 0
    if not 0 <= wanted < len(levels):
        told = f"GeoPosition asks for road level {wanted}, and there are {len(levels)}"
        raise ScenarioError(Diagnostic(told, "levels count from the lowest, 0", frame.source, frame.line))
    return levels[wanted]


def _surface(roads: RoadNetwork, x: float, y: float, z: float) -> float | None:
    """Height of the road nearest to a height [m]."""
    here = roads.locate([x], [y], [z]).location(0)
    return None if here is None else roads.pose(here).z


def _angles(frame: model.GeoPosition, context: ConditionContext) -> tuple[float, float]:
    """Latitude and longitude [rad]: since 1.2 in degrees, before that in radians.

    Older values beyond what radians can be are degrees that somebody wrote in their place.
    """
    if frame.latitude_deg is not None and frame.longitude_deg is not None:
        latitude, longitude = frame.latitude_deg, frame.longitude_deg
        in_degrees = True
    elif frame.latitude is not None and frame.longitude is not None:
        latitude, longitude = frame.latitude, frame.longitude
        in_degrees = abs(latitude) > math.pi / 2.0 or abs(longitude) > math.pi
        if in_degrees:
            told = (
                f"GeoPosition has latitude {latitude:g}, longitude {longitude:g}: taken as degrees, as radians end at π"
            )
            context.warn(Diagnostic(told, "use latitudeDeg and longitudeDeg", frame.source, frame.line))
    else:
        hint = "give latitudeDeg and longitudeDeg"
        raise ScenarioError(Diagnostic("GeoPosition lacks latitude or longitude", hint, frame.source, frame.line))
    if in_degrees:
        latitude, longitude = math.radians(latitude), math.radians(longitude)
    if abs(latitude) > math.pi / 2.0 or abs(longitude) > 2.0 * math.pi:
        told = f"GeoPosition has latitude {math.degrees(latitude):g}°, longitude {math.degrees(longitude):g}°"
        raise ScenarioError(Diagnostic(told, "latitudes end at ±90°", frame.source, frame.line))
    return latitude, longitude
