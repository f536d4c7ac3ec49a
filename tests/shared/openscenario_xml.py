"""OpenSCENARIO texts for tests: documents from their parts, and the parts that many tests need.

Documents are bytes, as in a file; parts are texts. The declarations of a scenario are in line 3, its catalogs in
line 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

HEADER = '<FileHeader revMajor="1" revMinor="{}" date="2026-01-31T12:00:00" description="a test" author="test"/>'

SCENARIO = """<OpenSCENARIO>
{header}
{declarations}
<CatalogLocations>{catalogs}</CatalogLocations>
<RoadNetwork>{road}</RoadNetwork>
<Entities>{entities}</Entities>
<Storyboard><Init><Actions>{init}</Actions></Init>{story}<StopTrigger>{stop}</StopTrigger></Storyboard>
</OpenSCENARIO>"""

VEHICLE = """<Vehicle name="{name}" vehicleCategory="car">
  <BoundingBox><Center x="{x}" y="0" z="0.75"/><Dimensions length="{size}" width="{width}" height="1.5"/></BoundingBox>
  <Performance maxSpeed="{speed}" maxAcceleration="{acceleration}" maxDeceleration="{deceleration}"{limits}/>
  <Axles>
    <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="{track}" positionX="{wheelbase}" positionZ="0.3"/>
    <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="{track}" positionX="0" positionZ="0.3"/>
  </Axles>
  <Properties/>
</Vehicle>"""


# Vehicles and controllers


def vehicle_xml(
    name: str = "car",
    *,
    length: float = 4.5,
    width: float = 1.8,
    center: float = 1.4,
    wheelbase: float = 2.8,
    max_speed: float = 60,
    max_acceleration: float = 5,
    max_deceleration: float = 9,
    limits: str = "",
) -> str:
    """Return a car: its box [m], the distance of the box center before the rear axle [m], its performance [m/s, m/s²].

    `limits` are further attributes of the performance.
    """
    return VEHICLE.format(
        name=name,
        size=length,
        width=width,
        x=center,
        track=f"{width - 0.2:g}",
        wheelbase=wheelbase,
        speed=max_speed,
        acceleration=max_acceleration,
        deceleration=max_deceleration,
        limits=f" {limits}" if limits else "",
    )


def object_xml(name: str, inside: str = "", controller: str = "") -> str:
    """Return a scenario object: a car by default, with an optional controller."""
    return f'<ScenarioObject name="{name}">{inside or vehicle_xml()}{controller}</ScenarioObject>'


def round_car_xml(name: str, controller: str = "", *, max_deceleration: float = 10, limits: str = "") -> str:
    """Return a car with round numbers: box of 5 x 2 m from 1 m behind the rear axle, 70 m/s, 10 m/s²."""
    vehicle = vehicle_xml(
        name,
        length=5,
        width=2,
        center=1.5,
        wheelbase=3,
        max_speed=70,
        max_acceleration=10,
        max_deceleration=max_deceleration,
        limits=limits,
    )
    return object_xml(name, vehicle, controller)


def controller_xml(properties: Mapping[str, object] | None = None, *, name: str = "c", attributes: str = "") -> str:
    """Return an object controller with properties, one per line, and further attributes of the controller."""
    given = {name: quoteattr(str(value)) for name, value in (properties or {}).items()}
    lines = "".join(f"<Property name={quoteattr(name)} value={value}/>\n" for name, value in given.items())
    more = f" {attributes}" if attributes else ""
    return (
        f'<ObjectController><Controller name="{name}"{more}><Properties>\n{lines}</Properties></Controller>'
        "</ObjectController>"
    )


def agent_xml(**properties: object) -> str:
    """Return the controller of a station with these properties."""
    return controller_xml({"module": "eidrive", **properties})


# Documents


def parameters_xml(**declared: tuple[str, str]) -> str:
    """Return parameter declarations from `name=(type, value)`."""
    return _declarations("Parameter", declared)


def variables_xml(**declared: tuple[str, str]) -> str:
    """Return variable declarations from `name=(type, value)`."""
    return _declarations("Variable", declared)


def _declarations(kind: str, declared: Mapping[str, tuple[str, str]]) -> str:
    attribute = f"{kind.lower()}Type"
    inside = "".join(
        f'<{kind}Declaration name="{name}" {attribute}="{type_}" value="{value}"/>'
        for name, (type_, value) in declared.items()
    )
    return f"<{kind}Declarations>{inside}</{kind}Declarations>"


def road_file_xml(path: object) -> str:
    """Return the road file of a scenario."""
    return f"<LogicFile filepath={quoteattr(str(path))}/>"


def scenario_xml(
    *,
    minor: int = 3,
    declarations: str = "",
    catalogs: str = "",
    road: str = "",
    entities: str | None = None,
    init: str = "",
    story: str = "",
    stop: str = "",
) -> bytes:
    """Return a scenario from its parts, by default with the car Ego only. Declarations and stories are complete
    elements; the other parts are contents of their elements.
    """
    return SCENARIO.format(
        header=HEADER.format(minor),
        declarations=declarations,
        catalogs=catalogs,
        road=road,
        entities=object_xml("Ego") if entities is None else entities,
        init=init,
        story=story,
        stop=stop,
    ).encode()


def catalog_xml(name: str, entries: str, *, minor: int = 3) -> bytes:
    """Return a catalog; its entries begin in line 3."""
    catalog = f'<Catalog name="{name}">\n{entries}\n</Catalog>'
    return f"<OpenSCENARIO>{HEADER.format(minor)}\n{catalog}</OpenSCENARIO>".encode()


def distribution_xml(body: str, *, scenario: object = "scenario.xosc", minor: int = 3) -> bytes:
    """Return a parameter value distribution of a scenario file; the body begins in line 5."""
    return (
        f"<OpenSCENARIO>\n{HEADER.format(minor)}\n<ParameterValueDistribution>\n"
        f"<ScenarioFile filepath={quoteattr(str(scenario))}/>\n{body}\n</ParameterValueDistribution>\n</OpenSCENARIO>"
    ).encode()


def deterministic_xml(*distributions: str) -> str:
    """Return a deterministic distribution of parameters, one per line."""
    return "<Deterministic>\n" + "\n".join(distributions) + "\n</Deterministic>"


def single_xml(parameter: str, distribution: str) -> str:
    """Return the deterministic distribution of one parameter."""
    kind = "DeterministicSingleParameterDistribution"
    return f'<{kind} parameterName="{parameter}">{distribution}</{kind}>'


def values_xml(parameter: str, *values: str) -> str:
    """Return a deterministic distribution of a parameter over listed values."""
    elements = "".join(f'<Element value="{value}"/>' for value in values)
    return single_xml(parameter, f"<DistributionSet>{elements}</DistributionSet>")
