"""Parts of scenarios: background traffic, its road users and its positions."""

from __future__ import annotations

from storyboard_xml import global_xml, lane_position_xml, time_xml
from whole_run import RecordedRun

PEDESTRIAN = (
    '<Pedestrian name="walker" mass="70" pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/>'
    '<Dimensions width="0.5" length="0.5" height="1.8"/></BoundingBox></Pedestrian>'
)
VEHICLE = (
    '<Vehicle name="cart" vehicleCategory="car"><BoundingBox><Center x="1" y="0" z="0.75"/>'
    '<Dimensions width="1.5" length="3" height="1.5"/></BoundingBox>'
    '<Performance maxSpeed="{}" maxAcceleration="3" maxDeceleration="8"/>'
    '<Axles><RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.2" positionX="0" positionZ="0.3"/></Axles>'
    "</Vehicle>"
)


def traffic(inside: str, name: str = "crowd") -> str:
    given = f' trafficName="{name}"' if name else ""
    return global_xml(f"<TrafficAction{given}>{inside}</TrafficAction>")


def definition(*categories: tuple[str, float], **properties: object) -> str:
    """Return a traffic definition of vehicle categories with weights, by default cars, and properties of its driver."""
    shares = "".join(
        f'<VehicleCategoryDistributionEntry category="{category}" weight="{weight}"/>'
        for category, weight in categories or (("car", 1),)
    )
    given = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties.items())
    return (
        f'<TrafficDefinition name="mix"><VehicleCategoryDistribution>{shares}</VehicleCategoryDistribution>'
        '<ControllerDistribution><ControllerDistributionEntry weight="1"><Controller name="d"><Properties>'
        f"{given}</Properties></Controller></ControllerDistributionEntry></ControllerDistribution></TrafficDefinition>"
    )


def distribution(*entities: tuple[float, str]) -> str:
    entries = "".join(
        f'<EntityDistributionEntry weight="{weight}"><ScenarioObjectTemplate>{body}</ScenarioObjectTemplate>'
        "</EntityDistributionEntry>"
        for weight, body in entities
    )
    return (
        '<TrafficDistribution><TrafficDistributionEntry weight="1"><EntityDistribution>'
        f"{entries}</EntityDistribution></TrafficDistributionEntry></TrafficDistribution>"
    )


def swarm(
    count: int = 12, *, center: str = "Ego", inner: float = 30, reach: float = 150, more: str = "", **given: str
) -> str:
    attributes = "".join(f' {name}="{value}"' for name, value in given.items())
    return (
        f'<TrafficSwarmAction innerRadius="{inner}" semiMajorAxis="{reach}" semiMinorAxis="60" offset="0" '
        f'numberOfVehicles="{count}"{attributes}><CentralObject entityRef="{center}"/>{more}</TrafficSwarmAction>'
    )


def position(s: float, lane: int = -1) -> str:
    return f"<Position>{lane_position_xml(lane, s)}</Position>"


def source(rate: float, s: float, *, more: str = "", **given: float) -> str:
    attributes = "".join(f' {name}="{value}"' for name, value in given.items())
    return f'<TrafficSourceAction radius="3" rate="{rate}"{attributes}>{position(s)}{more}</TrafficSourceAction>'


def sink(s: float, rate: str = "") -> str:
    return f'<TrafficSinkAction radius="15"{rate}>{position(s)}</TrafficSinkAction>'


def area(count: int, continuous: str, where: str, entities: str = "") -> str:
    return (
        f'<TrafficAreaAction numberOfEntities="{count}" continuous="{continuous}">'
        f"{entities or distribution((1.0, VEHICLE.format(20)))}<TrafficArea>{where}</TrafficArea></TrafficAreaAction>"
    )


def road_range(start: float, end: float, lanes: str = "") -> str:
    cursor = '<RoadCursor roadId="1" s="{}">{}</RoadCursor>'
    return f"<RoadRange>{cursor.format(start, lanes)}{cursor.format(end, '')}</RoadRange>"


def at_time(value: float) -> str:
    return time_xml(value, "greaterOrEqual")


def crowd(played: RecordedRun, time: float, name: str = "crowd") -> list[str]:
    """Return the names of the road users of a traffic at a time."""
    frame = played.frames[round(time / 0.05)]
    return [one for one in frame.view.names if one.startswith(f"{name}.")]
