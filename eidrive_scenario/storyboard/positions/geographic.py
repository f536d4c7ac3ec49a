"""Geographic positions, by the geoReference of the road network."""

from __future__ import annotations

import math

from eidrive_scenario.errors import Diagnostic, InputError, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.orientations import oriented
from eidrive_scenario.storyboard.positions.position_errors import roads_of

HEIGHT_LIMIT = 1e4
"""Height above and below all roads [m]."""
LEVEL_SEPARATION = 0.5
"""Maximum difference in height of roads on one level [m]."""


def geo_position(frame: model.GeoPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a GeoPosition by the projection of the road network.

    Relative and missing angles refer to the lane at the position.
    """
    roads = roads_of(frame, context)
    x, y = plane_coordinates(frame, roads, context)
    height = frame.altitude if frame.altitude is not None else frame.height
    z = height_of_level(frame, roads, x, y) if height is None else height - roads.header.offset[2]
    here = roads.locate_at(x, y, z=z)
    base = roads.pose(here) if here is not None else Pose(x, y, 0.0, 0.0, 0.0, 0.0)
    return ResolvedPosition(oriented(frame.orientation, base._replace(x=x, y=y, z=base.z if z is None else z)), here)


def plane_coordinates(frame: model.GeoPosition, roads: RoadNetwork, context: ConditionContext) -> tuple[float, float]:
    """Return x and y of a GeoPosition [m]. Raise ScenarioError if the road network has no geoReference."""
    latitude, longitude = _angles(frame, context)
    try:
        return roads.geographic(latitude, longitude)
    except InputError as error:
        reason = error.diagnostics[0]
        message = Diagnostic(f"GeoPosition: not resolvable: {reason.message}", reason.hint, frame.source, frame.line)
        raise ScenarioError(message) from error


def height_of_level(frame: model.GeoPosition, roads: RoadNetwork, x: float, y: float) -> float | None:
    """Return z of the road selected by verticalRoadSelection, counted from 0, the lowest [m]; None without a road.

    Raise ScenarioError if the level does not exist.
    """
    low, high = (_surface(roads, x, y, end) for end in (-HEIGHT_LIMIT, HEIGHT_LIMIT))
    if low is None or high is None:
        return None
    levels = [low]
    for step in range(1, math.ceil((high - low) / LEVEL_SEPARATION) + 1):
        found = _surface(roads, x, y, low + step * LEVEL_SEPARATION)
        if found is not None and found > levels[-1] + LEVEL_SEPARATION:
            levels.append(found)
    level = frame.vertical_road_selection or 0
    if not 0 <= level < len(levels):
        message = "GeoPosition: the selected road level does not exist"
        hint = f"got {level}; expected 0 to {len(levels) - 1}, counted from the lowest"
        raise ScenarioError(Diagnostic(message, hint, frame.source, frame.line))
    return levels[level]


def _surface(roads: RoadNetwork, x: float, y: float, z: float) -> float | None:
    """Return the height of the road that is nearest to a height [m]; None without a road."""
    here = roads.locate([x], [y], [z]).location(0)
    return None if here is None else roads.pose(here).z


def _angles(frame: model.GeoPosition, context: ConditionContext) -> tuple[float, float]:
    """Return latitude and longitude [rad]: since 1.2 given in degrees, before in radians.

    Older values beyond the range of radians are read as degrees, with a warning.
    """
    if frame.latitude_deg is not None and frame.longitude_deg is not None:
        latitude, longitude = frame.latitude_deg, frame.longitude_deg
        in_degrees = True
    elif frame.latitude is not None and frame.longitude is not None:
        latitude, longitude = frame.latitude, frame.longitude
        in_degrees = abs(latitude) > math.pi / 2.0 or abs(longitude) > math.pi
        if in_degrees:
            message = f"GeoPosition: latitude {latitude:g}, longitude {longitude:g} are read as degrees, not radians"
            context.warn(Diagnostic(message, "use latitudeDeg and longitudeDeg", frame.source, frame.line))
    else:
        hint = "give latitudeDeg and longitudeDeg"
        raise ScenarioError(Diagnostic("GeoPosition: latitude or longitude is missing", hint, frame.source, frame.line))
    if in_degrees:
        latitude, longitude = math.radians(latitude), math.radians(longitude)
    if abs(latitude) > math.pi / 2.0 or abs(longitude) > 2.0 * math.pi:
        message = f"GeoPosition: invalid latitude {math.degrees(latitude):g}° or longitude {math.degrees(longitude):g}°"
        raise ScenarioError(
            Diagnostic(message, "expected latitudes within ±90°, longitudes within ±360°", frame.source, frame.line)
        )
    return latitude, longitude
