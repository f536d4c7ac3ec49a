"""Coverage table of docs/openscenario.md, generated from the registries, the model and the tests.

A test declares the elements that it demonstrates by `@pytest.mark.element("SpeedAction", …)`. `python
tests/coverage_table.py` writes the table between its two marks in the page. tests/test_coverage_table.py fails if page,
tests or registries do not match.
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

from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.model.element import USAGE, Element, Usage

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "openscenario.md"
BEGIN, END = "<!-- coverage table: begin -->", "<!-- coverage table: end -->"


@dataclass(frozen=True)
class Row:
    """Line of the table: name in the marks of tests, types of the standard, and restrictions."""

    name: str
    types: tuple[str, ...] = ()
    note: str = ""
    """Reason why it has no effect, a partial effect, or is rejected."""
    without_effect: bool = False
    rejected: bool = False
    begins: str = ""
    """First version, if it does not follow from the types."""


def _rows(*names: str) -> tuple[Row, ...]:
    return tuple(Row(name) for name in names)


SECTIONS: dict[str, tuple[Row, ...]] = {
    "Private actions": (
        *_rows("SpeedAction", "SpeedProfileAction", "LongitudinalDistanceAction", "LaneChangeAction"),
        *_rows("LaneOffsetAction", "LateralDistanceAction", "VisibilityAction", "SynchronizeAction"),
        Row("ActivateControllerAction", note="a controller of another tool is replaced by the default controller"),
        Row("AssignControllerAction", note="only for other tools; module=eidrive is rejected during the run"),
        Row("OverrideControllerValueAction", note="for a scripted vehicle it is only recorded, as it has no pedals"),
        Row("TeleportAction"),
        Row("AssignRouteAction"),
        *_rows("FollowTrajectoryAction", "AcquirePositionAction", "RandomRouteAction"),
        Row("PreferredLaneLayerAction", note="permanent lanes; the temporary layer is an error here and in positions"),
        Row("LightStateAction", note="a UserDefinedLight is only recorded, as its position is undefined"),
        Row("AnimationAction", note="motions of pedestrians are drawn, all others are only recorded"),
        *_rows("ConnectTrailerAction", "DisconnectTrailerAction"),
    ),
    "Global and user-defined actions": (
        Row("EnvironmentAction", note="images, sensors and friction; temperature, pressure, dome image: only recorded"),
        *_rows("AddEntityAction", "DeleteEntityAction", "ParameterSetAction", "ParameterModifyAction"),
        *_rows(
            "VariableSetAction", "VariableModifyAction", "TrafficSignalStateAction", "TrafficSignalControllerAction"
        ),
        *_rows("TrafficSwarmAction", "TrafficSourceAction", "TrafficSinkAction", "TrafficAreaAction"),
        *_rows("TrafficStopAction", "TrafficDefinition", "TrafficDistribution", "SetMonitorAction"),
        Row("CustomCommandAction", note="never starts a program; unknown types are reported"),
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
        Row("UserDefinedDistribution", note="specific to another tool", rejected=True),
    ),
}

LIGHTS = "no controller model controls lights or animations"
MOTION = "the times of a trajectory determine the speed; without times, the longitudinal action does, with a warning"
WITHOUT_EFFECT = {
    "ActivateControllerAction.lighting": LIGHTS,
    "AnimationFile.timeOffset": "animation files are recorded, not executed",
    "AssignControllerAction.activateAnimation": LIGHTS,
    "AssignControllerAction.activateLighting": LIGHTS,
    "Clothoid.MotionEnd": MOTION,
    "Clothoid.MotionStart": MOTION,
    "ClothoidSpline.MotionEnd": MOTION,
    "ClothoidSplineSegment.MotionStart": MOTION,
    "Controller.controllerType": "the property `module` determines the tool",
    "DomeImage.azimuthOffset": "the sky is computed from sun, clouds and fog",
    "Motion.acceleration_longitudinal": MOTION,
    "Motion.speed_longitudinal": MOTION,
    "OverrideSteeringWheelAction.maxTorque": "the steering wheel angle is set without a torque",
    "Pedestrian.pedestrianCategory": "wheelchairs and animals move and are detected as pedestrians",
    "Properties.CustomContent": "the meaning is undefined",
    "RoadNetwork.SceneGraphFile": "images are rendered from the road file",
    "RoadNetwork.UsedArea": "the complete map is loaded",
    "Sensor.horizontalFOV": "sensors are those of the station's controller",
    "Sensor.sensorCategory": "sensors are those of the station's controller",
    "Sensor.verticalFOV": "sensors are those of the station's controller",
    "SensorAttachment.MountingPosition": "sensors are those of the station's controller",
    "SensorAttachment.sensorRef": "sensors are those of the station's controller",
    "SensorAttachments.SensorAttachment": "sensors are those of the station's controller",
    "Vehicle.SensorAttachments": "sensors are those of the station's controller",
}
"""Attributes and children of the standard that are read and checked, but not used by the engine."""

ABOUT_THE_FILE = {"FileHeader", "License"}
TAKEN_BY_CLASS = {
    *("AppearanceAction", "CatalogLocations", "ControllerAction", "PrivateAction", "Position"),
    *("DeterministicSingleParameterDistribution", "StochasticDistribution"),
}
"""Elements whose children the engine selects by class, not by the name of the field."""


@cache
def marked_tests() -> dict[str, list[str]]:
    """Return the sorted tests with the mark of each name, as `file::function`."""
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
    """Return the first version of the standard that has the types of a row below the root element."""
    versions = _versions()
    return row.begins or max(versions.get(name, "1.0") for name in row.types or (row.name,))


@cache
def _versions() -> dict[str, str]:
    """Return the first version of every type in which a reachable type has a field of it."""
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
"""Modules that print attributes without using them."""
EXPORT = ROOT / "eidrive_scenario" / "export"
"""Package whose words are fields of other formats, such as `mounting_position` of OSI."""


def unread() -> set[str]:
    """Return the attributes and children of the model whose names do not occur elsewhere in the engine.

    Exempt are elements about the file itself, children that are selected by a class with a single field, and attributes
    that only `eidrive list` prints.
    """
    packages = ("eidrive_scenario", "behaviors", "criteria")
    code = (path for package in packages for path in (ROOT / package).rglob("*.py"))
    read = (path for path in code if path.parent != MODEL and path.name not in PRINTED and EXPORT not in path.parents)
    texts = (path.read_text(encoding="utf-8") for path in read)
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
    """Return the table in Markdown."""
    tests = marked_tests()
    registered = {*registry("actions"), *registry("conditions")}
    lines = []
    for title, rows in SECTIONS.items():
        lines += [f"### {title}", "", "| element | since | status | demonstrated by |", "|---|---|---|---|"]
        for row in rows:
            status = "accepted without effect" if row.without_effect else "executed"
            if row.rejected:
                status = "rejected"
            if row.note:
                status += f"; {row.note}" if status == "executed" else f": {row.note}"
            if row.name.endswith(("Action", "Condition")) and row.name not in registered:
                status = "**missing**"
            shown = "<br>".join(f"`{place}`" for place in tests.get(row.name, [])[:2]) or "**no test**"
            lines.append(f"| {row.name} | {since(row)} | {status} | {shown} |")
        lines.append("")
    lines += ["### Attributes and children without effect", "", "| attribute or child | reason |", "|---|---|"]
    lines += [f"| {name} | {why} |" for name, why in WITHOUT_EFFECT.items()]
    return "\n".join(lines)


def page(text: str) -> str:
    """Return the page with a regenerated table."""
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"written: {PAGE.relative_to(ROOT)}\n")
