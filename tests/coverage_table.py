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
from collections import defaultdict
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
    """Why it is accepted without effect, in part or as a whole."""
    without_effect: bool = False


def _rows(*names: str) -> tuple[Row, ...]:
    return tuple(Row(name) for name in names)


SECTIONS: dict[str, tuple[Row, ...]] = {
    "Private actions": (
        *_rows(
            "SpeedAction",
            "SpeedProfileAction",
            "LongitudinalDistanceAction",
            "LaneChangeAction",
            "LaneOffsetAction",
            "LateralDistanceAction",
            "VisibilityAction",
            "SynchronizeAction",
            "ActivateControllerAction",
            "AssignControllerAction",
            "OverrideControllerValueAction",
            "TeleportAction",
            "AssignRouteAction",
            "FollowTrajectoryAction",
            "AcquirePositionAction",
            "RandomRouteAction",
            "LightStateAction",
            "AnimationAction",
            "ConnectTrailerAction",
            "DisconnectTrailerAction",
        ),
    ),
    "Global and user-defined actions": _rows(
        "EnvironmentAction",
        "AddEntityAction",
        "DeleteEntityAction",
        "ParameterSetAction",
        "ParameterModifyAction",
        "VariableSetAction",
        "VariableModifyAction",
        "TrafficSignalStateAction",
        "TrafficSignalControllerAction",
        "TrafficSwarmAction",
        "TrafficSourceAction",
        "TrafficSinkAction",
        "TrafficAreaAction",
        "TrafficStopAction",
        "SetMonitorAction",
        "CustomCommandAction",
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
        Row("priority override", ("Event",)),
        Row("priority parallel", ("Event",)),
        Row("priority skip", ("Event",)),
        Row("Event maximumExecutionCount", ("Event",)),
        Row("Event without StartTrigger", ("Event",)),
        Row("ManeuverGroup maximumExecutionCount", ("ManeuverGroup",)),
        Row("edge rising", ("Condition",)),
        Row("edge none", ("Condition",)),
        Row("edge falling", ("Condition",)),
        Row("edge risingOrFalling", ("Condition",)),
        Row("delay", ("Condition",)),
        Row("triggeringEntitiesRule", ("TriggeringEntities",)),
        Row("selectTriggeringEntities", ("Actors",)),
        Row("several condition groups", ("Trigger",)),
        Row("Act StopTrigger", ("Act",)),
        Row("Storyboard StopTrigger", ("Storyboard",)),
        Row("conflicting actions", ("PrivateAction",)),
    ),
    "Declarations, catalogs, distributions": (
        Row("CatalogReference"),
        Row("ParameterAssignment"),
        Row("$parameter", ("ParameterDeclaration",)),
        Row("${expression}", ("ParameterDeclaration",)),
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
    ),
}


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
    return max(versions.get(name, "1.0") for name in row.types or (row.name,))


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


def table() -> str:
    """The table in Markdown."""
    tests = marked_tests()
    registered = {*registry("actions"), *registry("conditions")}
    lines = []
    for title, rows in SECTIONS.items():
        lines += [f"### {title}", "", "| element | since | status | shown by |", "|---|---|---|---|"]
        for row in rows:
            status = "accepted without effect" if row.without_effect else "executed"
            if row.note:
                status += f": {row.note}" if row.without_effect else f"; {row.note}"
            if row.name.endswith(("Action", "Condition")) and row.name not in registered:
                status = "**missing**"
            shown = "<br>".join(f"`{place}`" for place in tests.get(row.name, [])[:2]) or "**no test**"
            lines.append(f"| {row.name} | {since(row)} | {status} | {shown} |")
        lines.append("")
    return "\n".join(lines)


def page(text: str) -> str:
    """The page with its table made anew."""
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\n{table()}\n{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.stdout.write(f"written: {PAGE.relative_to(ROOT)}\n")
