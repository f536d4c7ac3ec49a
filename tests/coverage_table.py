"""The coverage table of docs/openscenario.md, made from the registries, the model and the tests.

A test says what it shows by `@pytest.mark.element("SpeedAction", …)`. `python tests/coverage_table.py` writes the table
between its two marks in the page; tests/test_coverage_table.py fails where page, tests or registries drift apart.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.model.element import USAGE, Element, Usage
from eidrive_scenario.registry import registry

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "openscenario.md"
BEGIN, END = "<!-- coverage table: begin -->", "<!-- coverage table: end -->"


@dataclass(frozen=True)
class Row:
    """One line of the table: the name that tests mark, the types of the standard behind it, what it cannot show."""

    name: str
    types: tuple[str, ...] = ()
    note: str = ""
    """Why it is accepted without effect, in part or as a whole; or refused."""
    without_effect: bool = False
    refused: bool = False
    begins: str = ""
    """The version that brought it, where that does not follow from the types."""


def _rows(*names: str) -> tuple[Row, ...]:
    return tuple(Row(name) for name in names)


OF_1_2 = "1.2 defines it, with no place for it in the schema"

SECTIONS: dict[str, tuple[Row, ...]] = {
    "Private actions": (
        *_rows("SpeedAction", "SpeedProfileAction", "LongitudinalDistanceAction", "LaneChangeAction"),
        *_rows("LaneOffsetAction", "LateralDistanceAction", "VisibilityAction", "SynchronizeAction"),
        Row("ActivateControllerAction", note="controllers of other tools mean the default controller"),
        Row("AssignControllerAction", note="other tools' controllers only; one of ours is refused during the run"),
        Row("OverrideControllerValueAction", note="of a scripted vehicle it is recorded only: that one has no pedals"),
        Row("TeleportAction"),
        Row("AssignRouteAction"),
        *_rows("FollowTrajectoryAction", "AcquirePositionAction", "RandomRouteAction"),
        Row("LightStateAction", note=f"{OF_1_2}; a UserDefinedLight is recorded only: nothing says where it is"),
        Row("AnimationAction", note=f"{OF_1_2}; pedestrians' motions are drawn, all others are recorded only"),
        *_rows("ConnectTrailerAction", "DisconnectTrailerAction"),
    ),
    "Global and user-defined actions": (
        Row("EnvironmentAction", note="pictures, sensors and grip; temperature, pressure, dome image: recorded only"),
        *_rows("AddEntityAction", "DeleteEntityAction", "ParameterSetAction", "ParameterModifyAction"),
        *_rows(
            "VariableSetAction", "VariableModifyAction", "TrafficSignalStateAction", "TrafficSignalControllerAction"
        ),
        *_rows("TrafficSwarmAction", "TrafficSourceAction", "TrafficSinkAction", "TrafficAreaAction"),
        *_rows("TrafficStopAction", "TrafficDefinition", "TrafficDistribution", "SetMonitorAction"),
        Row("CustomCommandAction", note="never starts a program; types that nobody knows are reported"),
    ),
    "Entity conditions": _rows(
        "EndOfRoadCondition",
        "CollisionCondition",
        "OffroadCondition",
        "TimeHeadwayCondition",
        "TimeToCollisionCondition",
        "AccelerationCondition",
        "StandStillCondition",
        "SpeedCondition",
        "RelativeSpeedCondition",
        "TraveledDistanceCondition",
        "ReachPositionCondition",
        "DistanceCondition",
        "RelativeDistanceCondition",
        "RelativeClearanceCondition",
        "AngleCondition",
        "RelativeAngleCondition",
    ),
    "Value conditions": _rows(
        "SimulationTimeCondition",
        "StoryboardElementStateCondition",
        "ParameterCondition",
        "VariableCondition",
        "TrafficSignalCondition",
        "TrafficSignalControllerCondition",
        "TimeOfDayCondition",
        "UserDefinedValueCondition",
    ),
    "Positions": _rows(
        "WorldPosition",
        "RelativeWorldPosition",
        "RelativeObjectPosition",
        "LanePosition",
        "RelativeLanePosition",
        "RoadPosition",
        "RelativeRoadPosition",
        "RoutePosition",
        "TrajectoryPosition",
        "GeoPosition",
    ),
    "Trajectories": _rows("Polyline", "Clothoid", "ClothoidSpline", "Nurbs", "Timing"),
    "Storyboard": (
        Row("priority overwrite", ("Event",)),
        Row("priority override", ("Event",), begins="1.2"),
        Row("priority parallel", ("Event",)),
        Row("priority skip", ("Event",)),
        Row("Event maximumExecutionCount", ("Event",)),
        Row("Event without StartTrigger", ("Event",), begins="1.1"),
        Row("ManeuverGroup maximumExecutionCount", ("ManeuverGroup",)),
        Row("edge rising", ("Condition",)),
        Row("edge none", ("Condition",)),
        Row("edge falling", ("Condition",)),
        Row("edge risingOrFalling", ("Condition",)),
        Row("delay", ("Condition",)),
        Row("triggeringEntitiesRule", ("TriggeringEntities",)),
        Row("selectTriggeringEntities", ("Actors",)),
        Row("several condition groups", ("Trigger",)),
        Row("Act StartTrigger", ("Act",)),
        Row("Act StopTrigger", ("Act",)),
        Row("Storyboard StopTrigger", ("Storyboard",)),
        Row("conflicting actions", ("PrivateAction",)),
    ),
    "Declarations, catalogs, distributions": (
        Row("CatalogReference"),
        Row("ParameterAssignment"),
        Row("$parameter", ("ParameterDeclaration",)),
        Row("${expression}", ("ParameterDeclaration",), begins="1.1"),
        Row("ConstraintGroup", ("ValueConstraintGroup",)),
        Row("VariableDeclaration"),
        Row("MonitorDeclaration"),
        Row("TrafficSignalController"),
        Row("EntitySelection"),
        Row("ExternalObjectReference"),
        Row("DistributionSet"),
        Row("DistributionRange"),
        Row("ValueSetDistribution"),
        Row("UniformDistribution"),
        Row("NormalDistribution"),
        Row("LogNormalDistribution"),
        Row("PoissonDistribution"),
        Row("Histogram"),
        Row("ProbabilityDistributionSet"),
        Row("UserDefinedDistribution", note="its meaning is left to a tool", refused=True),
    ),
}

LIGHTS = "no controller here steers lights or animations, so that there is nothing to switch on or off"
WITHOUT_EFFECT = {
    "ActivateControllerAction.lighting": LIGHTS,
    "AnimationFile.timeOffset": "files of animations are recorded, not played",
    "AssignControllerAction.activateAnimation": LIGHTS,
    "AssignControllerAction.activateLighting": LIGHTS,
    "Axle.positionZ": "wheels stand on the road",
    "Controller.controllerType": "its property `module` says whose it is",
    "DomeImage.azimuthOffset": "the sky is computed from sun, clouds and fog",
    "OverrideSteeringWheelAction.maxTorque": "a wheel is held at an angle, without forces at the rim",
    "Pedestrian.pedestrianCategory": "wheelchairs and animals move and are seen as pedestrians",
    "Properties.CustomContent": "nothing says what it means",
    "RoadNetwork.SceneGraphFile": "pictures are drawn from the road file",
    "RoadNetwork.UsedArea": "the whole map is there: the area says which part would do",
    "Sensor.horizontalFOV": "sensors are those of the station's controller",
    "Sensor.sensorCategory": "sensors are those of the station's controller",
    "Sensor.verticalFOV": "sensors are those of the station's controller",
    "SensorAttachment.MountingPosition": "sensors are those of the station's controller",
    "SensorAttachment.sensorRef": "sensors are those of the station's controller",
    "SensorAttachments.SensorAttachment": "sensors are those of the station's controller",
    "Vehicle.SensorAttachments": "sensors are those of the station's controller",
    "Vehicle.vehicleRole": "a word about a vehicle; traffic draws roles from its own distribution",
}
"""Attributes and children of the standard that are read and checked, and that nothing else in the engine looks at."""

ABOUT_THE_FILE = {"FileHeader", "License"}
TAKEN_BY_CLASS = {
    *("AppearanceAction", "CatalogLocations", "ControllerAction", "PrivateAction", "Position"),
    *("DeterministicSingleParameterDistribution", "StochasticDistribution"),
}
"""Elements whose children the engine takes whichever is there, by what it is, not by the name of the field."""


def marked_tests() -> dict[str, list[str]]:
    """Which tests carry the mark of each name, as `file::function`, sorted."""
    found: dict[str, set[str]] = defaultdict(set)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef) and function.name.startswith("test_"):
                place = f"{path.relative_to(ROOT).as_posix()}::{function.name}"
                for name in _marks(function):
                    found[name].add(place)
    return {name: sorted(places) for name, places in found.items()}


def _marks(function: ast.FunctionDef) -> Iterator[str]:
    for decorator in function.decorator_list:
        for call in ast.walk(decorator):
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "pytest.mark.element":
                yield from (ast.literal_eval(argument) for argument in call.args)


def since(row: Row) -> str:
    """The first version of the standard that has a row's types somewhere below the root element."""
    versions = _versions()
    return row.begins or max(versions.get(name, "1.0") for name in row.types or (row.name,))


@cache
def _versions() -> dict[str, str]:
    """The first version of every type: of a field that holds it, in a type that was there by then."""
    owners = {owner.__name__: owner for owner in _elements()}
    first = {"OpenScenario": "1.0"}
    waiting = ["OpenScenario"]
    while waiting:
        owner = waiting.pop()
        for field in dataclasses.fields(owners[owner]):
            usage: Usage = field.metadata.get(USAGE, Usage())
            begins = max(first[owner], usage.since or "1.0")
            for name in re.findall(r"\w+", str(field.type)):
                if name in owners and begins < first.get(name, "9"):
                    first[name] = begins
                    waiting.append(name)
    return first


def _elements() -> Iterator[type[Element]]:
    for value in vars(model).values():
        if inspect.isclass(value) and issubclass(value, Element) and value is not Element:
            yield value


MODEL = ROOT / "eidrive_scenario" / "openscenario" / "model"
PRINTED = ("library_catalogs.py",)
"""Modules that print attributes and give them no effect."""


def unread() -> set[str]:
    """The attributes and children in the model whose names stand nowhere else in the engine.

    Not counted: what is about the file itself, children that are known by their class, where it has one place only, and
    what `eidrive list` prints.
    """
    code = (path for room in ("eidrive_scenario", "behaviors", "criteria") for path in (ROOT / room).rglob("*.py"))
    texts = (path.read_text(encoding="utf-8") for path in code if path.parent != MODEL and path.name not in PRINTED)
    words = {word for text in texts for word in re.findall(r"\w+", text)} | {"line", "source"}
    elements = {element.__name__ for element in _elements()}
    places = Counter(
        name
        for element in _elements()
        for field in dataclasses.fields(element)
        for name in elements & set(re.findall(r"\w+", str(field.type)))
    )
    found = set()
    for element in _elements():
        for field in dataclasses.fields(element):
            held = elements & set(re.findall(r"\w+", str(field.type)))
            by_class = any(name in words and places[name] == 1 for name in held) or (
                bool(held) and element.__name__ in TAKEN_BY_CLASS
            )
            if field.name not in words and not by_class and element.__name__ not in ABOUT_THE_FILE:
                usage: Usage = field.metadata.get(USAGE, Usage())
                found.add(f"{element.__name__}.{usage.name or _spelling(field.name, capital=bool(held))}")
    return found


def _spelling(name: str, *, capital: bool) -> str:
    first, *rest = name.split("_")
    return (first.capitalize() if capital else first) + "".join(word.capitalize() for word in rest)


def table() -> str:
    """The table in Markdown."""
    tests = marked_tests()
    registered = {*registry("actions"), *registry("conditions")}
    lines = []
    for title, rows in SECTIONS.items():
        lines += [f"### {title}", "", "| element | since | status | shown by |", "|---|---|---|---|"]
        for row in rows:
            status = "accepted without effect" if row.without_effect else "executed"
            if row.refused:
                status = "refused"
            if row.note:
                status += f"; {row.note}" if status == "executed" else f": {row.note}"
            if row.name.endswith(("Action", "Condition")) and row.name not in registered:
                status = "**missing**"
            shown = "<br>".join(f"`{place}`" for place in tests.get(row.name, [])[:2]) or "**no test**"
            lines.append(f"| {row.name} | {since(row)} | {status} | {shown} |")
        lines.append("")
    lines += ["### Attributes and children without effect", "", "| which | why |", "|---|---|"]
    lines += [f"| {name} | {why} |" for name, why in WITHOUT_EFFECT.items()]
    return "\n".join(lines)


def page(text: str) -> str:
    """The page with its table made anew."""
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"written: {PAGE.relative_to(ROOT)}\n")
