from datetime import datetime

import pytest
from lxml import etree
from openscenario_xml import catalog_xml, deterministic_xml, distribution_xml, scenario_xml, single_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, model, read_document

TRAJECTORY = """<PrivateAction><RoutingAction><FollowTrajectoryAction>{inside}
<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>
</FollowTrajectoryAction></RoutingAction></PrivateAction>"""
CURVE = """<Trajectory name="t" closed="false"><Shape><Polyline>
<Vertex time="0"><Position><WorldPosition x="0" y="0"/></Position></Vertex>
<Vertex time="1"><Position><WorldPosition x="9" y="0"/></Position></Vertex>
</Polyline></Shape></Trajectory>"""


def diagnostics_of(xml: bytes) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(xml)
    return [diagnostic.message for diagnostic in caught.value.diagnostics]


def private(action: str) -> str:
    return f'<Private entityRef="Ego">{action}</Private>'


def test_values_have_the_types_of_the_model() -> None:
    scenario = load_scenario(scenario_xml(story=story_xml(speed="12")))
    header = scenario.document.file_header
    assert (header.rev_major, header.rev_minor, header.date) == (1, 3, datetime(2026, 1, 31, 12))
    event = scenario.storyboard.story[0].act[0].maneuver_group[0].maneuver[0].event[0]
    assert event.priority is model.Priority.PARALLEL
    action = event.action[0].chosen()
    assert isinstance(action, model.PrivateAction)
    speed = action.chosen().chosen()
    assert isinstance(speed, model.SpeedAction)
    assert speed.speed_action_dynamics.dynamics_shape is model.DynamicsShape.LINEAR
    assert speed.speed_action_target.chosen() == model.AbsoluteTargetSpeed(value=12.0)


def test_elements_have_lines() -> None:
    xml = scenario_xml()
    before, _, _ = xml.partition(b"<Vehicle name")
    ego = load_scenario(xml).entities["Ego"]
    assert (ego.source, ego.line) == ("<bytes>", 1 + before.count(b"\n"))


def test_element_text_is_read() -> None:
    command = '<CustomCommandAction type="x">{a: <!-- no --> 1}\n</CustomCommandAction>'
    xml = scenario_xml(init=f"<UserDefinedAction>{command}</UserDefinedAction>")
    action = load_scenario(xml).storyboard.init.actions.user_defined_action[0]
    assert action.custom_command_action.content == "{a:  1}\n"


def test_text_between_elements_is_an_error() -> None:
    assert diagnostics_of(scenario_xml(init="stray")) == ["Actions contains text; only elements are allowed"]


def test_optional_attribute_is_required_in_older_version() -> None:
    assert diagnostics_of(scenario_xml(minor=1)) == ["Storyboard lacks the element Story"]
    assert load_scenario(scenario_xml(minor=2)).version == (1, 2)


def test_literals_are_valid_only_in_their_versions() -> None:
    story = story_xml()
    old = story.replace('priority="parallel"', 'priority="overwrite"')
    assert load_scenario(scenario_xml(minor=1, story=old)).warnings == ()
    assert len(load_scenario(scenario_xml(minor=2, story=old)).warnings) == 1
    new = story.replace('priority="parallel"', 'priority="override"')
    with pytest.raises(ScenarioError, match=r"part of OpenSCENARIO since 1\.2; the version of the file is 1\.1"):
        load_scenario(scenario_xml(minor=1, story=new))


def test_deprecated_use_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(init=private(TRAJECTORY.format(inside=CURVE))))
    assert [warning.message for warning in scenario.warnings] == [
        "Trajectory in FollowTrajectoryAction is deprecated since OpenSCENARIO 1.1"
    ]
    current = scenario_xml(init=private(TRAJECTORY.format(inside=f"<TrajectoryRef>{CURVE}</TrajectoryRef>")))
    assert load_scenario(current).warnings == ()


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ("", "PrivateAction lacks one of LongitudinalAction, LateralAction"),
        ("<TeleportAction/><TeleportAction/>", "TeleportAction is not allowed here again"),
        ("<TeleportAction/><VisibilityAction/>", "VisibilityAction is not allowed here"),
        ("<TeleportAction/>", "TeleportAction lacks the element Position"),
    ],
)
def test_invalid_structure_is_an_error(action: str, message: str) -> None:
    found = diagnostics_of(scenario_xml(init=private(f"<PrivateAction>{action}</PrivateAction>")))
    assert any(one.startswith(message) for one in found)


def test_missing_second_vertex_is_an_error() -> None:
    first, _, _ = CURVE.partition('<Vertex time="1">')
    xml = scenario_xml(init=private(TRAJECTORY.format(inside=f"{first}</Polyline></Shape></Trajectory>")))
    assert diagnostics_of(xml) == ["Polyline lacks another Vertex"]


def test_attribute_of_newer_version_error_has_version() -> None:
    entity = '<ScenarioObject name="Ego"><Pedestrian name="p" mass="80" pedestrianCategory="pedestrian" role="police">'
    box = '<BoundingBox><Center x="0" y="0" z="1"/><Dimensions length="1" width="1" height="2"/></BoundingBox>'
    xml = scenario_xml(minor=1, entities=f"{entity}{box}<Properties/></Pedestrian></ScenarioObject>")
    with pytest.raises(ScenarioError, match=r"no attribute 'role'; part of OpenSCENARIO since 1\.2"):
        load_scenario(xml)


def test_an_empty_action_is_a_warning_and_an_empty_position_is_not() -> None:
    empty = story_xml().replace("<PrivateAction>", "<!--").replace("</PrivateAction>", "-->")
    assert [warning.message for warning in load_scenario(scenario_xml(minor=2, story=empty)).warnings] == [
        "Action is empty"
    ]
    teleport = private("<PrivateAction><TeleportAction><Position/></TeleportAction></PrivateAction>")
    assert diagnostics_of(scenario_xml(minor=2, init=teleport)) == ["Position is empty"]


def test_schema_location_is_ignored() -> None:
    root = etree.fromstring(scenario_xml())
    root.set("{http://www.w3.org/2001/XMLSchema-instance}noNamespaceSchemaLocation", "OpenSCENARIO.xsd")
    assert load_scenario(root).version == (1, 3)


def test_byte_order_mark_and_other_encodings_are_read() -> None:
    text = scenario_xml().decode()
    assert load_scenario(b"\xef\xbb\xbf" + text.encode()).version == (1, 3)
    assert load_scenario(('<?xml version="1.0" encoding="UTF-16"?>' + text).encode("utf-16")).version == (1, 3)


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        (b"", "not well-formed XML: no element found"),
        (b"<OpenDRIVE/>", "the root element is OpenDRIVE (expected OpenSCENARIO)"),
        (b"<OpenSCENARIO/>", "OpenSCENARIO lacks the element FileHeader"),
        (b"<OpenSCENARIO><FileHeader revMajor='1'/></OpenSCENARIO>", "FileHeader lacks the attribute 'revMinor'"),
        (b"<OpenSCENARIO><FileHeader revMajor='2' revMinor='0'/></OpenSCENARIO>", "FileHeader has the version 2.0"),
        (b"<a>" * 150 + b"</a>" * 150, "nested deeper than 100 levels"),
        ("<!DOCTYPE x><x/>".encode("utf-16"), "document type declaration"),
    ],
)
def test_other_file_kinds_are_errors(xml: bytes, message: str) -> None:
    assert any(message in found for found in diagnostics_of(xml))


def test_read_document_accepts_catalogs() -> None:
    xml = catalog_xml("Routes", "", minor=0)
    document = read_document(xml)
    assert document.catalog is not None
    assert document.catalog.name == "Routes"
    assert diagnostics_of(xml) == ["the file is a catalog, not a scenario"]


def test_read_document_accepts_distributions() -> None:
    steps = '<DistributionRange stepWidth="5"><Range lowerLimit="10" upperLimit="30"/></DistributionRange>'
    xml = distribution_xml(deterministic_xml(single_xml("Speed", steps)), scenario="cut_in.xosc", minor=2)
    distribution = read_document(xml).parameter_value_distribution
    assert distribution is not None
    assert distribution.deterministic is not None
    single = distribution.deterministic.deterministic_single_parameter_distribution[0]
    assert single.chosen() == model.DistributionRange(
        step_width=5.0, range=model.Range(lower_limit=10.0, upper_limit=30.0)
    )
    with pytest.raises(ScenarioError, match=r"not a scenario; its scenario is 'cut_in\.xosc'"):
        load_scenario(xml)
