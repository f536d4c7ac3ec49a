"""Rules of `eidrive check`: docs/checks.md describes each rule, and each of its examples violates only this rule."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import etree

from eidrive_scenario.checks.registry import ALL_RULES, run_rules
from eidrive_scenario.checks.rule import Level
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.openscenario import load_scenario

DOCUMENT = Path(__file__).parents[3] / "docs" / "checks.md"

ROAD = """<OpenDRIVE><header revMajor="1" revMinor="6"/><road name="street" length="200" id="1" junction="-1"><link/>
  <planView><geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>
  <lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
  <right><lane id="-1" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
  </laneSection></lanes></road></OpenDRIVE>"""

CATALOG = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2025-01-01T00:00:00" description="cars" author="test"/>
<Catalog name="cars"><Vehicle name="car" vehicleCategory="car">
  <BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions length="4.5" width="1.8" height="1.5"/></BoundingBox>
  <Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
</Vehicle></Catalog></OpenSCENARIO>"""

SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
  <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>
  <SpeedActionTarget><AbsoluteTargetSpeed value="10"/></SpeedActionTarget>
  </SpeedAction></LongitudinalAction></PrivateAction>"""

TIME = """<ConditionGroup><Condition name="at {0} s" delay="0" conditionEdge="none"><ByValueCondition>
  <SimulationTimeCondition rule="greaterOrEqual" value="{0}"/></ByValueCondition></Condition></ConditionGroup>"""

PLACED = """<Private entityRef="{}"><PrivateAction><TeleportAction><Position>
  <LanePosition roadId="1" laneId="-1" s="{}"/></Position></TeleportAction></PrivateAction></Private>"""

SCENARIO = f"""<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2025-01-01T00:00:00" description="a scaffold" author="test"/>
<ParameterDeclarations/><VariableDeclarations/><MonitorDeclarations/>
<CatalogLocations><VehicleCatalog><Directory path="."/></VehicleCatalog></CatalogLocations>
<RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>
<Entities>
  <ScenarioObject name="Ego"><CatalogReference catalogName="cars" entryName="car"/></ScenarioObject>
  <ScenarioObject name="Other"><CatalogReference catalogName="cars" entryName="car"/></ScenarioObject>
</Entities>
<Storyboard><Init><Actions>{PLACED.format("Ego", 10)}{PLACED.format("Other", 50)}</Actions></Init>
<Story name="Story"><Act name="Act">
  <ManeuverGroup name="Group" maximumExecutionCount="1">
    <Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>
    <Maneuver name="Maneuver">
      <Event name="First" priority="override"><Action name="Speed">{SPEED}</Action>
        <StartTrigger>{TIME.format(1)}</StartTrigger></Event>
      <Event name="Later" priority="parallel"><Action name="Speed later">{SPEED}</Action>
        <StartTrigger>{TIME.format(9)}</StartTrigger></Event>
    </Maneuver>
  </ManeuverGroup>
</Act></Story>
<StopTrigger>{TIME.format(20)}</StopTrigger></Storyboard></OpenSCENARIO>"""

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
ROAD_ELEMENTS = {"header", "link", "planView", "lateralProfile", "lanes", "signals", "junction"}
"""Elements of the road file."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a road of 200 m with one lane, and a catalog with one car."""
    (tmp_path / "street.xodr").write_text(ROAD, encoding="utf-8")
    (tmp_path / "cars.xosc").write_text(CATALOG, encoding="utf-8")
    return tmp_path


def diagnostics_of(folder: Path, *fragments: str, text: str = SCENARIO) -> list[tuple[Level, Diagnostic]]:
    """Return the diagnostics of the rules in the scaffold with additional or replaced elements."""
    root = etree.fromstring(text)
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
    assert "above-max-speed" in violated_rules(folder, SPEED.replace('value="10"', 'value="-61"'))
    assert "above-max-speed" not in violated_rules(folder, SPEED.replace('value="10"', 'value="-60"'))


def test_run_rules_ignored_rule_yields_nothing(folder: Path) -> None:
    diagnostics_of(folder, "<StopTrigger/>")
    scenario = load_scenario(folder / "scenario.xosc")
    assert list(run_rules(scenario, ["no-stop-trigger"])) == []
    with pytest.raises(SettingError, match="unknown rule 'no-stop'; did you mean 'no-stop-trigger'"):
        list(run_rules(scenario, ["no-stop"]))
