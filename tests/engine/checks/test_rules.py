"""Rules of `eidrive check`: docs/checks.md describes each rule, and each of its examples violates only this rule."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import etree
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import catalog_xml, object_xml, road_file_xml, scenario_xml, vehicle_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    event_xml,
    group_xml,
    groups_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.checks.rule import Level
from eidrive_scenario.checks.scenario_checks import ALL_RULES, check_scenario, run_rules
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.openscenario import load_scenario

DOCUMENT = Path(__file__).parents[3] / "docs" / "checks.md"

ROAD = map_xml(road_xml(length=200.0, lanes=lanes_xml(0, 1, 4)))
CATALOG = catalog_xml("cars", vehicle_xml())
SPEED = speed_xml(10, 2)


def car(name: str) -> str:
    return object_xml(name, '<CatalogReference catalogName="cars" entryName="car"/>')


def at(time: float) -> str:
    return condition_xml(time_xml(time, "greaterOrEqual"), name=f"at {time} s")


EVENTS = event_xml("First", SPEED, trigger_xml(at(1)), priority="override") + event_xml(
    "Later", SPEED, trigger_xml(at(9))
)
SCENARIO = scenario_xml(
    declarations="<ParameterDeclarations/><VariableDeclarations/><MonitorDeclarations/>",
    catalogs='<VehicleCatalog><Directory path="."/></VehicleCatalog>',
    road=road_file_xml("street.xodr"),
    entities=car("Ego") + car("Other"),
    init="".join(init_xml(name, teleport_xml(lane_position_xml(-1, s))) for name, s in (("Ego", 10), ("Other", 50))),
    story=acts_xml(act_xml(group_xml(maneuver_xml(EVENTS, "Maneuver"), name="Group"), name="Act"), name="Story"),
    stop=groups_xml(at(20)),
)

INTO = {
    "EntitySelection": "Entities",
    "Event": "Maneuver",
    "ManeuverGroup": "Act",
    "MonitorDeclaration": "MonitorDeclarations",
    "ParameterDeclaration": "ParameterDeclarations",
    "PedestrianCatalog": "CatalogLocations",
    "Private": "Init/Actions",
    "VariableDeclaration": "VariableDeclarations",
}
"""Element of the scaffold to which the element of an example is added."""
REPLACED = {
    "GlobalAction": "PrivateAction",
    "PrivateAction": "PrivateAction",
    "StartTrigger": "StartTrigger",
}
"""Part of the first event that the element of an example replaces."""
ROAD_ELEMENTS = {"header", "link", "planView", "lateralProfile", "lanes", "objects", "signals", "junction"}
"""Elements of the road file."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a road of 200 m with one lane, and a catalog with one car."""
    (tmp_path / "street.xodr").write_text(ROAD, encoding="utf-8")
    (tmp_path / "cars.xosc").write_bytes(CATALOG)
    return tmp_path


def diagnostics_of(folder: Path, *fragments: str) -> list[tuple[Level, Diagnostic]]:
    """Return the diagnostics of the rules in the scaffold with additional or replaced elements."""
    root = etree.fromstring(SCENARIO)
    for fragment in fragments:
        for element in list(etree.fromstring(f"<Fragment>{fragment}</Fragment>")):
            if element.tag in ROAD_ELEMENTS:
                put_on_road(folder, element)
            else:
                put(root, element)
    path = folder / "scenario.xosc"
    path.write_bytes(etree.tostring(root, pretty_print=True))
    return list(run_rules(load_scenario(path)))


def descendant(root: etree._Element, path: str) -> etree._Element:
    """Return the first element at a path below `root`."""
    element = root.find(path)
    assert element is not None, path
    return element


def replace(old: etree._Element, new: etree._Element) -> None:
    parent = old.getparent()
    assert parent is not None
    parent.replace(old, new)


def put_on_road(folder: Path, element: etree._Element) -> None:
    """Replace a part of the road by an example, or add the example to the road file."""
    root = etree.fromstring(ROAD)
    old = root.find(f".//{element.tag}")
    if old is None:
        (root if element.tag == "junction" else descendant(root, "road")).append(element)
    elif element.get("layer") == "temporary":
        old.addnext(element)
    else:
        replace(old, element)
    (folder / "street.xodr").write_bytes(etree.tostring(root, pretty_print=True))


def put(root: etree._Element, element: etree._Element) -> None:
    if element.tag == "StopTrigger":
        old = descendant(root, "Storyboard/StopTrigger")
    elif element.tag in REPLACED:
        old = descendant(root, f".//Event[@name='First']//{REPLACED[element.tag]}")
    elif element.tag == "ScenarioObject":
        descendant(root, "Entities").insert(0, element)
        return
    else:
        descendant(root, f".//{INTO[element.tag]}").append(element)
        return
    replace(old, element)


def violated_rules(folder: Path, *fragments: str) -> set[str]:
    return {diagnostic.rule for _, diagnostic in diagnostics_of(folder, *fragments)}


def documented() -> Iterator[tuple[str, str, str]]:
    """Yield name, level and example of each rule in docs/checks.md."""
    text = DOCUMENT.read_text(encoding="utf-8")
    for part in re.split(r"^### ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        matched = re.fullmatch(r"`([a-z-]+)` \((\w+)\)", heading)
        assert matched is not None, heading
        name, level = matched.groups()
        examples = re.findall(r"^```xml\n(.*?)^```", body, flags=re.MULTILINE | re.DOTALL)
        assert len(examples) == 1, name
        after = body.rpartition("```")[2].partition("\n## ")[0].strip()
        assert after, f"{name} has no correction"
        yield name, level, examples[0]


EXAMPLES = {name: (level, example) for name, level, example in documented()}


def test_document_lists_every_rule_with_its_level() -> None:
    assert {name: level for name, (level, _) in EXAMPLES.items()} == {r.name: r.level.value for r in ALL_RULES}
    assert len(ALL_RULES) == len({rule.name for rule in ALL_RULES})


def test_scaffold_violates_no_rule(folder: Path) -> None:
    assert diagnostics_of(folder) == []


@pytest.mark.parametrize("name", EXAMPLES)
def test_document_example_violates_only_its_rule(folder: Path, name: str) -> None:
    level, example = EXAMPLES[name]
    found = diagnostics_of(folder, example)
    assert {diagnostic.rule for _, diagnostic in found} == {name}
    assert {level.value for level, _ in found} == {level}
    in_road_file = etree.fromstring(f"<Fragment>{example}</Fragment>")[0].tag in ROAD_ELEMENTS
    for _, diagnostic in found:
        assert diagnostic.source == str(folder / ("street.xodr" if in_road_file else "scenario.xosc"))
        assert diagnostic.line is not None
        assert diagnostic.hint


def test_above_max_speed_applies_to_negative_speeds(folder: Path) -> None:
    assert "above-max-speed" in violated_rules(folder, speed_xml(-61, 2))
    assert "above-max-speed" not in violated_rules(folder, speed_xml(-60, 2))


def test_above_max_speed_omits_profiles_relative_to_an_entity(folder: Path) -> None:
    """Behind an entity at 80 m/s, a difference of -70 m/s is a speed of 10 m/s."""
    entries = '<SpeedProfileEntry time="2" speed="-70"/></SpeedProfileAction></LongitudinalAction></PrivateAction>'
    action = "<PrivateAction><LongitudinalAction><SpeedProfileAction {} followingMode='position'>" + entries
    assert "above-max-speed" in violated_rules(folder, action.format(""))
    assert "above-max-speed" not in violated_rules(folder, action.format('entityRef="Other"'))


def test_conflicting_actions_include_continuous_steps(folder: Path) -> None:
    """A step to a relative speed with `continuous` controls the speed until another action ends it."""
    example = EXAMPLES["conflicting-actions"][1]
    example = re.sub(
        'Shape="linear" dynamicsDimension="time" value="2"', 'Shape="step" dynamicsDimension="time" value="0"', example
    )
    target = '<RelativeTargetSpeed entityRef="Other" value="0" speedTargetValueType="delta" continuous="{}"/>'
    for continuous in ("true", "false"):
        event = example.replace('<AbsoluteTargetSpeed value="5"/>', target.format(continuous))
        assert ("conflicting-actions" in violated_rules(folder, event)) == (continuous == "true")


@pytest.mark.parametrize(
    ("lateral", "limit"),
    [
        (
            """<LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="sinusoidal"{}/>
            <LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget></LaneOffsetAction>""",
            ' maxLateralAcc="1"',
        ),
        (
            """<LateralDistanceAction entityRef="Other" continuous="false" freespace="false" distance="3">{}
            </LateralDistanceAction>""",
            '<DynamicConstraints maxSpeed="1"/>',
        ),
    ],
)
def test_conflicting_actions_exempt_lateral_actions_without_limits(folder: Path, lateral: str, limit: str) -> None:
    """Without a limit the offset or distance is reached at once."""
    for given, is_conflict in (("", False), (limit, True)):
        private = f"<PrivateAction><LateralAction>{lateral.format(given)}</LateralAction></PrivateAction>"
        action = f'<Action name="{{}}">{private}</Action>'
        event = f'<Event name="e" priority="parallel">{action.format("a")}{action.format("b")}</Event>'
        assert ("conflicting-actions" in violated_rules(folder, event)) == is_conflict


@pytest.mark.parametrize("lane", ["-1", "-01", "-2"])
def test_unknown_lane_compares_numbers(folder: Path, lane: str) -> None:
    example = re.sub(r'(<AbsoluteTargetLane value=)"[^"]*"', rf'\1"{lane}"', EXAMPLES["unknown-lane"][1])
    assert f'value="{lane}"' in example
    assert ("unknown-lane" in violated_rules(folder, example)) == (lane == "-2")


def test_lane_of_thousands_of_digits_is_an_error_of_the_setup(folder: Path) -> None:
    """Python converts at most 4300 digits."""
    example = re.sub(r'(<AbsoluteTargetLane value=)"[^"]*"', rf'\1"{"9" * 5000}"', EXAMPLES["unknown-lane"][1])
    assert diagnostics_of(folder, example) == []
    (error,) = check_scenario(folder / "scenario.xosc").errors
    assert error.message.startswith("LaneChangeAction: the target lane is not a number")


@pytest.mark.parametrize("turned", ["waypoint", "actor", ""])
def test_no_route_accepts_a_route_of_a_wrong_way_driver(folder: Path, turned: str) -> None:
    """The route of the example leads back; its waypoints, or the position of its actor, may face that way."""
    _, example = EXAMPLES["no-route"]
    orientation = '<Orientation type="relative" h="3.141592653589793"/>'
    if turned == "waypoint":
        example = re.sub(r"(<LanePosition[^>]*)/>", rf"\1>{orientation}</LanePosition>", example)
    place = lane_position_xml(-1, 100.0, inside=orientation if turned == "actor" else "")
    assert ("no-route" in violated_rules(folder, example, init_xml("Ego", teleport_xml(place)))) == (not turned)


def test_run_rules_ignored_rule_yields_nothing(folder: Path) -> None:
    diagnostics_of(folder, "<StopTrigger/>")
    scenario = load_scenario(folder / "scenario.xosc")
    assert list(run_rules(scenario, ["no-stop-trigger"])) == []
    with pytest.raises(SettingError, match="unknown rule 'no-stop'; did you mean 'no-stop-trigger'"):
        list(run_rules(scenario, ["no-stop"]))
