"""Weather, time of day and road condition."""

from __future__ import annotations

from datetime import datetime

from eidrive_scenario.openscenario.model.declarations import CatalogReference, File, ParameterDeclarations, Properties
from eidrive_scenario.openscenario.model.element import ALL, Choice, Element, attribute, child, element_type
from eidrive_scenario.openscenario.model.entities import BoundingBox
from eidrive_scenario.openscenario.model.entity_enumerations import (
    CloudState,
    FractionalCloudCover,
    PrecipitationType,
    Wetness,
)


@element_type
class TimeOfDay(Element):
    """Date and time, and whether the time advances."""

    animation: bool
    date_time: datetime


@element_type
class Sun(Element):
    """Sun with azimuth and elevation [rad] and illuminance [lx]."""

    azimuth: float
    elevation: float
    intensity: float | None = attribute(deprecated="1.2", required_until="1.1")
    illuminance: float | None = attribute(since="1.2")


@element_type
class Fog(Element, content=ALL):
    """Fog with visual range [m], optionally in a bounding box."""

    visual_range: float
    bounding_box: BoundingBox | None = None


@element_type
class Precipitation(Element):
    """Precipitation intensity [mm/h]."""

    precipitation_type: PrecipitationType
    intensity: float | None = attribute(deprecated="1.1", required_until="1.0")
    precipitation_intensity: float | None = attribute(since="1.1")


@element_type
class Wind(Element):
    """Wind with direction of flow [rad] and speed [m/s]."""

    direction: float
    speed: float


@element_type
class DomeImage(Element):
    """Image of the sky; azimuth offset [rad]."""

    azimuth_offset: float | None = None
    dome_file: File


@element_type
class Weather(Element, content=ALL):
    """Weather; pressure [Pa], temperature [K]."""

    cloud_state: CloudState | None = attribute(deprecated="1.2", required_until="1.0")
    atmospheric_pressure: float | None = attribute(since="1.1")
    temperature: float | None = attribute(since="1.1")
    fractional_cloud_cover: FractionalCloudCover | None = attribute(since="1.2")
    sun: Sun | None = child(required_until="1.0")
    fog: Fog | None = child(required_until="1.0")
    precipitation: Precipitation | None = child(required_until="1.0")
    wind: Wind | None = child(since="1.1")
    dome_image: DomeImage | None = child(since="1.2")


@element_type
class RoadCondition(Element):
    """Friction of the road relative to the reference friction."""

    friction_scale_factor: float
    wetness: Wetness | None = attribute(since="1.2")
    properties: Properties | None = None


@element_type
class Environment(Element, content=ALL):
    """Time of day, weather and road condition."""

    name: str
    parameter_declarations: ParameterDeclarations | None = None
    time_of_day: TimeOfDay | None = child(required_until="1.0")
    weather: Weather | None = child(required_until="1.0")
    road_condition: RoadCondition | None = child(required_until="1.0")


@element_type
class EnvironmentAction(Element, content=Choice(empty_until="1.2")):
    """Action that sets the environment."""

    environment: Environment | None = None
    catalog_reference: CatalogReference | None = None
