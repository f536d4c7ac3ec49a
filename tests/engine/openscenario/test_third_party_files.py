"""Files of third-party editors and tools: encodings, names, numbers and typical errors."""

import codecs
from pathlib import Path

import pytest
from openscenario_xml import scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario

PROFILE = """<LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="{dimension}" value="{extent}"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>"""
TIMED = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false"><Shape><Polyline>
<Vertex time="0"><Position><WorldPosition x="0" y="0"/></Position></Vertex>
<Vertex time="1"><Position><WorldPosition x="9" y="0"/></Position></Vertex></Polyline></Shape></Trajectory>
</TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="relative" scale="{scale}" offset="0"/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""
FOG_LIGHTS = """<AppearanceAction><LightStateAction {more}><LightType><VehicleLight vehicleLightType="fogLights"/>
</LightType><LightState mode="on" {state}/></LightStateAction></AppearanceAction>"""
TOGETHER = """<SynchronizeAction masterEntityRef="Other" {more}><TargetPositionMaster><WorldPosition x="1" y="0"/>
</TargetPositionMaster><TargetPosition><WorldPosition x="1" y="0"/></TargetPosition>
<FinalSpeed><AbsoluteSpeed value="3"><TargetDistanceSteadyState distance="{steady}"/></AbsoluteSpeed></FinalSpeed>
</SynchronizeAction>"""
TELEPORT = '<TeleportAction><Position><WorldPosition x="{x}" y="0"/></Position></TeleportAction>'
LIMITED = """<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" continuous="false" freespace="false"
 distance="5"><DynamicConstraints maxAcceleration="{limit}"/></LongitudinalDistanceAction></LongitudinalAction>"""
SHAPED = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false"><Shape>{shape}
</Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""
ENDLESS = '<SimulationTimeCondition rule="greaterThan" value="INF"/>'
HERE = '<Position><WorldPosition x="0" y="0"/></Position>'
CLOTHOID = f"""<Clothoid curvature="0" curvaturePrime="0" length="{{length}}" startTime="2" stopTime="{{stop}}">{HERE}
</Clothoid>"""
POLYLINE = f"""<Polyline><Vertex time="0">{HERE}</Vertex><Vertex time="3">{HERE}</Vertex>
<Vertex time="2">{HERE}</Vertex>
</Polyline>"""
SPLINE = """<ClothoidSpline timeEnd="3">
<ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="5" timeStart="4"/>
</ClothoidSpline>"""


def curve(order: int, points: int, knots: str, more: str = "") -> str:
    """Return a FollowTrajectoryAction with a Nurbs."""
    control = f"<ControlPoint {more}>{HERE}</ControlPoint>" * points
    knot = "".join(f'<Knot value="{value}"/>' for value in knots.split())
    return SHAPED.format(shape=f'<Nurbs order="{order}">{control}{knot}</Nurbs>')


@pytest.mark.parametrize(
    ("declared", "encoding", "mark"),
    [
        ("utf-8", "utf-8", codecs.BOM_UTF8),
        ("utf-16", "utf-16", b""),
        ("", "utf-16-be", codecs.BOM_UTF16_BE),
        ("ISO-8859-1", "latin-1", b""),
        ("windows-1252", "cp1252", b""),
    ],
)
def test_document_encodings_are_read(declared: str, encoding: str, mark: bytes) -> None:
    text = scenario_xml().decode().replace('name="Ego"', 'name="Mäuschen"')
    head = f'<?xml version="1.0" encoding="{declared}"?>\n' if declared else ""
    assert list(load_scenario(mark + (head + text).encode(encoding)).entities) == ["Mäuschen"]


def test_comments_and_processing_instructions_have_no_effect() -> None:
    plain = scenario_xml(story=story_xml())
    dressed = plain.replace(
        b"<OpenSCENARIO>",
        b'<?xml-stylesheet href="a.xsl"?><!-- by hand -->'
        b'<OpenSCENARIO xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="a.xsd">',
    )
    dressed = dressed.replace(b"<Event ", b"<!-- first --><?tool keep?><Event ")
    assert load_scenario(dressed).storyboard == load_scenario(plain).storyboard


def test_document_namespace_is_an_error() -> None:
    xml = scenario_xml().replace(b"<OpenSCENARIO>", b'<OpenSCENARIO xmlns="urn:x">')
    with pytest.raises(ScenarioError, match=r"remove xmlns='urn:x'"):
        load_scenario(xml)


def test_names_in_any_script_are_read() -> None:
    xml = (
        scenario_xml(story=story_xml()).decode().replace("Ego", "車 ①").replace('"event"', '"&lt;ブレーキ &amp; 2&gt;"')
    )
    scenario = load_scenario(xml.encode())
    assert list(scenario.entities) == ["車 ①"]
    assert scenario.storyboard.story[0].act[0].maneuver_group[0].maneuver[0].event[0].name == "<ブレーキ & 2>"


@pytest.mark.parametrize(("written", "value"), [("1e1", 10.0), ("+5", 5.0), (" 2 ", 2.0), (".5", 0.5), ("1.E0", 1.0)])
def test_numbers_in_schema_notation_are_read(written: str, value: float) -> None:
    action = load_scenario(scenario_xml(story=story_xml(speed=written))).storyboard.story[0].act[0].maneuver_group[0]
    private = action.maneuver[0].event[0].action[0].private_action
    assert private is not None
    assert private.longitudinal_action is not None
    assert private.longitudinal_action.speed_action is not None
    target = private.longitudinal_action.speed_action.speed_action_target.absolute_target_speed
    assert target is not None
    assert target.value == value


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (PROFILE.format(dimension="time", extent=1, speed="NaN"), "value of AbsoluteTargetSpeed is NaN"),
        (PROFILE.format(dimension="time", extent="-1", speed=5), "a transition cannot take -1 s"),
        (PROFILE.format(dimension="distance", extent="-20", speed=5), "a transition cannot take -20 m"),
        (PROFILE.format(dimension="time", extent="INF", speed=5), "value of TransitionDynamics is INF"),
        (PROFILE.format(dimension="time", extent=1, speed="INF"), "value of AbsoluteTargetSpeed is INF"),
        (PROFILE.format(dimension="time", extent=1, speed="-1e300"), "value of AbsoluteTargetSpeed is -1e\\+300"),
        (TELEPORT.format(x="-INF"), "x of WorldPosition is -INF"),
        (LIMITED.format(limit="-1"), "maxAcceleration of DynamicConstraints is -1; a number of at least 0 is expected"),
        (
            LIMITED.format(limit="1").replace('"5"', '"-5"'),
            "distance of LongitudinalDistanceAction is -5; a number of at least 0 is expected",
        ),
        (
            LIMITED.format(limit="1").replace('distance="5"', 'timeGap="-1"'),
            "timeGap of LongitudinalDistanceAction is -1; a number of at least 0 is expected",
        ),
        (
            SHAPED.format(shape=CLOTHOID.format(length=0, stop=5)),
            "length of Clothoid is 0; a number above 0 is expected",
        ),
        (
            SHAPED.format(shape=CLOTHOID.format(length="1e-300", stop=5)),
            "length of Clothoid is 1e-300; a number of at least 1e-09 is expected",
        ),
        (SHAPED.format(shape=CLOTHOID.format(length=9, stop=1)), "times of the trajectory descend from 2 s to 1 s"),
        (SHAPED.format(shape=POLYLINE), "times of the trajectory descend from 3 s to 2 s"),
        (SHAPED.format(shape=SPLINE), "times of the trajectory descend from 4 s to 3 s"),
        (curve(1, 2, "0 1 2"), "Nurbs has the order 1; it must be at least 2"),
        (curve(21, 21, "0 1"), "Nurbs has the order 21; it must be at most 20"),
        (curve(2, 2, "0 0 1 0.5"), "Nurbs has descending knots"),
        (curve(2, 2, "0 1 1 1"), "Nurbs has no extent: its knots 2 to 3 are all 1"),
        (curve(2, 2, "0 0 1 1", 'weight="0"'), "weight of ControlPoint is 0; a number above 0 is expected"),
        (TIMED.format(scale=0), "Timing has the scale 0"),
        (TIMED.format(scale=-2), "Timing has the scale -2"),
        (
            FOG_LIGHTS.format(more='transitionTime="-1.2"', state=""),
            "transitionTime of LightStateAction is -1.2; a number",
        ),
        (
            FOG_LIGHTS.format(more="", state='flashingOnDuration="-1"'),
            "flashingOnDuration of LightState is -1; a number",
        ),
        (TOGETHER.format(more="", steady=-3), "distance of TargetDistanceSteadyState is -3; a number"),
        (
            TOGETHER.format(more='targetTolerance="-1"', steady=3),
            "targetTolerance of SynchronizeAction is -1; a number",
        ),
    ],
)
def test_unusable_numbers_are_errors(tmp_path: Path, action: str, message: str) -> None:
    path = tmp_path / "scene.xosc"
    path.write_bytes(scenario_xml(story=story_xml(action=action)))
    with pytest.raises(ScenarioError, match=rf"scene\.xosc:\d+: {message}"):
        load_scenario(path)


def test_infinite_rates_and_limits_are_accepted() -> None:
    for action in (PROFILE.format(dimension="rate", extent="INF", speed=5), LIMITED.format(limit="INF")):
        load_scenario(scenario_xml(story=story_xml(action=action)))
    load_scenario(scenario_xml(story=story_xml(condition=ENDLESS)))


def test_negative_rates_are_accepted() -> None:
    load_scenario(scenario_xml(story=story_xml(action=PROFILE.format(dimension="rate", extent="-4", speed=5))))
