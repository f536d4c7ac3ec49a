"""Parts of scenarios: background traffic, its road users and its positions."""

from __future__ import annotations

CATEGORIES = '<VehicleCategoryDistributionEntry category="car" weight="1"/>'
DRIVER = '<Controller name="d"><Properties><Property name="{}" value="{}"/></Properties></Controller>'
DEFINITION = (
    '<TrafficDefinition name="mix"><VehicleCategoryDistribution>{}</VehicleCategoryDistribution>'
    '<ControllerDistribution><ControllerDistributionEntry weight="1">{}</ControllerDistributionEntry>'
    "</ControllerDistribution></TrafficDefinition>"
)
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

FASTER = (
    "<PrivateAction><LongitudinalAction><SpeedAction>"
    '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
    '<SpeedActionTarget><AbsoluteTargetSpeed value="30"/></SpeedActionTarget></SpeedAction></LongitudinalAction>'
    "</PrivateAction>"
)


def traffic(inside: str, name: str = "crowd") -> str:
    given = f' trafficName="{name}"' if name else ""
    return f"<GlobalAction><TrafficAction{given}>{inside}</TrafficAction></GlobalAction>"


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
    return f'<Position><LanePosition roadId="1" laneId="{lane}" s="{s}"/></Position>'


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
    return f'<ByValueCondition><SimulationTimeCondition value="{value}" rule="greaterOrEqual"/></ByValueCondition>'
