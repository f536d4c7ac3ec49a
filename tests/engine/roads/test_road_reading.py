"""Tests of the OpenDRIVE reader: supported content and diagnostics of invalid files."""

import math
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree
from opendrive_xml import map_xml, road_xml
from road_errors import road_diagnostics

from eidrive_scenario.errors import Diagnostic, RoadError
from eidrive_scenario.roads import RoadNetwork, surface_meshes


def test_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match=r"none\.xodr: cannot read: No such file or directory; give the path"):
        RoadNetwork.load(tmp_path / "none.xodr")


def test_document_type_declaration_is_an_error() -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "b"><!ENTITY c "&a;&a;&a;&a;">]><OpenDRIVE>&c;</OpenDRIVE>'
    (found,) = road_diagnostics(bomb)
    assert found.startswith("town.xodr:1: the file has a document type declaration (DOCTYPE)")
    outside = '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/hostname">]><OpenDRIVE>&a;</OpenDRIVE>'
    assert road_diagnostics(outside) == [found]


def test_malformed_xml_and_other_xml_are_errors() -> None:
    (found,) = road_diagnostics("<OpenDRIVE>\n<road></OpenDRIVE>")
    assert found.startswith("town.xodr:2: not well-formed XML: an end tag does not match its start tag")
    assert road_diagnostics("<OpenSCENARIO/>") == [
        "town.xodr:1: the root element is not <OpenDRIVE>; is this another kind of file?"
    ]


def test_all_errors_are_reported_with_line_and_hint() -> None:
    text = map_xml(
        "\n"
        + road_xml("1", geometry='<geometry s="0" x="0" y="nan" hdg="0" length="100"><arc curvatur="0.1"/></geometry>'),
        "\n" + road_xml("1", rule="LTH"),
        "\n" + road_xml("2", link='<successor elementType="road" elementId="3" contactPoint="begin"/>'),
        "\n" + road_xml("3", geometry='<geometry s="0" x="0" y="0" hdg="0" length="100"><spline/></geometry>'),
    )
    assert road_diagnostics(text) == [
        "town.xodr:2: <geometry> has y='nan'; give a finite number",
        "town.xodr:2: <arc> lacks the attribute 'curvature'; did you mean 'curvatur'? (rename it to curvature)",
        "town.xodr:3: road '1' occurs twice; give each road a unique id",
        "town.xodr:3: road '1' has rule='LTH'; did you mean 'LHT'?",
        "town.xodr:4: <successor> has contactPoint='begin'; known: end, start",
        "town.xodr:5: unknown geometry <spline>; did you mean 'line'?",
        "town.xodr:5: road '3' has no <geometry>; add at least one",
    ]


def test_invalid_attribute_that_is_read_several_times_is_one_error() -> None:
    """Each repetition reads the size of the object."""
    repeats = '<repeat s="0" length="50" distance="5"/>' * 2
    thing = f'<object id="1" type="barrier" s="10" t="3" length="abc" height="1">{repeats}</object>'
    (error,) = road_diagnostics(map_xml(road_xml(extra=f"<objects>{thing}</objects>")))
    assert "length='abc'" in error


@pytest.mark.parametrize("kind", ["junction", "controller"])
def test_junctions_and_controllers_with_one_id_are_errors(kind: str) -> None:
    text = map_xml(road_xml(), *[f'\n<{kind} id="7" name="{name}"/>' for name in ("a", "b")])
    assert f"town.xodr:3: {kind} '7' occurs twice; give each {kind} a unique id" in road_diagnostics(text)


def sides(*parts: str) -> str:
    """Return a lane section with these sides."""
    return f'<laneSection s="0">{"".join(parts)}</laneSection>'


def one_lane(number: int) -> str:
    return f'<lane id="{number}" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>'


def test_duplicate_lanes_and_misplaced_center_are_errors() -> None:
    center, right = f"<center>{one_lane(0)}{one_lane(1)}</center>", f"<right>{one_lane(-1)}{one_lane(-1)}</right>"
    found = road_diagnostics(map_xml(road_xml(lanes=sides(f"<left>{one_lane(0)}</left>", center, right))))
    assert [line.split(": ", 1)[1] for line in found] == [
        "lane 0 is listed under <left>; left lanes have ids above 0, the center lane 0, right lanes ids below 0",
        "lane 1 is listed under <center>; left lanes have ids above 0, the center lane 0, right lanes ids below 0",
        "lane -1 occurs twice in its section; give each lane a unique id",
    ]


def test_side_of_a_lane_follows_its_id() -> None:
    left, right = f"<left>{one_lane(-1)}\n{one_lane(-2)}</left>", f"<right>{one_lane(1)}</right>"
    text = map_xml(road_xml(lanes=sides(left, "<center/>", right)))
    network = RoadNetwork.parse(text, "town.xodr")
    assert [network.lane_pose_at("1", lane, 10.0).y for lane in (1, -1, -2)] == [1.5, -1.5, -4.5]
    (warning,) = network.map_warnings
    assert warning.rule == "lane-side"
    assert str(warning) == (
        "town.xodr:1: lane -1 is listed under <left>; its id determines the side; "
        "2 more of lanes under the wrong side: line 2, 2; "
        "left lanes have ids above 0, the center lane 0, right lanes ids below 0"
    )


@pytest.mark.parametrize("what", ["junction", "road"])
def test_road_with_a_link_to_nothing_ends_there(what: str) -> None:
    link = f'<successor elementType="{what}" elementId="7" contactPoint="start"/>'
    network = RoadNetwork.parse(map_xml(road_xml(link=link), road_xml("2", y=50.0)), "town.xodr")
    (warning,) = network.map_warnings
    assert warning.rule == "road-link"
    assert str(warning) == (
        f"town.xodr:1: road '1' links to {what} '7', which does not exist; remove the link or add the {what}"
    )
    assert network.roads["1"].successor is None
    assert network.advance(network.location("1", -1, 90.0), 20.0) is None


@pytest.mark.parametrize(("length", "there"), [(100.0, "20 m before"), (50.0, "30 m after")])
def test_road_length_that_differs_from_geometry_is_replaced_with_a_warning(length: float, there: str) -> None:
    short = '<geometry s="0" x="0" y="0" hdg="0" length="80"><line/></geometry>'
    one_lane = (
        '<laneSection s="0"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving"><link>'
        '<{}cessor id="-1"/></link><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection>'
    )
    link = '<{}cessor elementType="road" elementId="{}" contactPoint="{}"/>'
    first = road_xml(geometry=short, length=length, link=link.format("suc", 2, "start"), lanes=one_lane.format("suc"))
    second = road_xml("2", x=80.0, link=link.format("prede", 1, "end"), lanes=one_lane.format("prede"))
    network = RoadNetwork.parse(map_xml(first, second), "town.xodr")
    assert network.roads["1"].length == 80.0
    assert [(warning.rule, warning.message) for warning in network.map_warnings] == [
        ("geometry-gap", f"road '1' has length {length:g} m, but its geometry ends {there} that and has priority")
    ]
    ahead = network.advance(network.location("1", -1, 70.0), 25.0)
    assert ahead is not None
    assert ahead.road == "2"
    assert ahead.s == pytest.approx(15.0)
    assert surface_meshes(network)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ('space="6"', "<line> lacks the attribute 'length'"),
        ('length="3"', "<line> lacks the attribute 'space'"),
        ('length="3m" space="6"', "<line> has length='3m'"),
        ('length="3" space="nan"', "<line> has space='nan'"),
    ],
)
def test_incomplete_road_mark_line_is_a_warning_and_follows_its_type(line: str, what: str) -> None:
    """A broken line with 3 m dashes at a pitch of 9 m on 100 m has 12 dashes, the last of 1 m."""
    lanes = (
        '<laneSection s="0"><center><lane id="0" type="none"><roadMark sOffset="0" type="broken" width="0.2">'
        f'<type name="x"><line {line}/></type></roadMark></lane></center><right><lane id="-1" type="driving">'
        '<width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection>'
    )
    network = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)), "town.xodr")
    (warning,) = network.map_warnings
    assert (warning.rule, warning.line) == ("road-mark", 1)
    assert warning.message == f"{what}, and is drawn without it"
    paint = next(mesh for mesh in surface_meshes(network) if mesh.kind == "marking_white")
    assert len(paint.faces) == 2 * 12


@pytest.mark.parametrize(
    "curve",
    [
        '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="-1e9" bV="0" cV="0" dV="0" pRange="arcLength"/>',
        '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0" dV="1e9" pRange="normalized"/>',
        '<poly3 a="0" b="0" c="0" d="1e6"/>',
    ],
)
def test_curve_of_excessive_extent_is_an_error(curve: str) -> None:
    """A grid over such a road would take gigabytes."""
    text = road_xml("1", geometry=f'<geometry s="0" x="0" y="0" hdg="0" length="100">{curve}</geometry>')
    far = [found for found in road_diagnostics(map_xml(text)) if "a geometry of road '1' leads " in found]
    assert len(far) == 1
    assert "at most 1e+06 m are read" in far[0]


def test_namespace_is_ignored() -> None:
    text = map_xml(road_xml()).replace(
        "<OpenDRIVE>", '<OpenDRIVE xmlns="http://code.asam.net/simulation/standard/opendrive_schema">'
    )
    assert list(RoadNetwork.parse(text).roads) == ["1"]


def test_borders_equal_widths() -> None:
    def lane(number: int, entry: str) -> str:
        return f'<lane id="{number}" type="driving">{entry}</lane>'

    def section(inner: str, outer: str) -> str:
        return (
            '<laneOffset s="0" a="0.5" b="0" c="0" d="0"/><laneSection s="0"><center><lane id="0"/></center>'
            f"<right>{lane(-1, inner)}{lane(-2, outer)}</right></laneSection>"
        )

    borders = section(
        '<border sOffset="0" a="-2.5" b="-0.01" c="0" d="0"/>', '<border sOffset="0" a="-6" b="-0.03" c="0" d="0"/>'
    )
    widths = section(
        '<width sOffset="0" a="3" b="0.01" c="0" d="0"/>', '<width sOffset="0" a="3.5" b="0.02" c="0" d="0"/>'
    )
    one, two = (RoadNetwork.parse(map_xml(road_xml(lanes=lanes))) for lanes in (borders, widths))
    for s in (0.0, 33.0, 100.0):
        for number in (-1, -2):
            assert one.lane_width("1", number, s) == pytest.approx(two.lane_width("1", number, s))
            assert one.lane_pose_at("1", number, s) == pytest.approx(two.lane_pose_at("1", number, s))


def test_single_side_sections_continue_the_other_side() -> None:
    def part(s: int, tag: str, number: int, a: float, b: float) -> str:
        lane = f'<lane id="{number}" type="driving"><width sOffset="0" a="{a}" b="{b}" c="0" d="0"/></lane>'
        center = '<center><lane id="0"/></center>'
        return f'<laneSection s="{s}" singleSide="true"><{tag}>{lane}</{tag}>{center}</laneSection>'

    lanes = part(0, "right", -1, 3.0, 0.01) + part(0, "left", 1, 4.0, 0.0) + part(40, "left", 1, 2.0, 0.0)
    network = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)))
    assert network.lane_width("1", -1, 70.0) == pytest.approx(3.7)
    assert [network.lane_width("1", 1, s) for s in (39.0, 41.0)] == [4.0, 2.0]
    moved = network.advance(network.location("1", -1, 10.0), 80.0)
    assert moved is not None
    assert moved.s == pytest.approx(90.0, abs=0.2)


def test_speed_limit_of_lane_overrides_road() -> None:
    lane = (
        '<lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/>'
        '<speed sOffset="20" max="30" unit="mph"/></lane>'
    )
    kinds = (
        '<type s="0" type="town"><speed max="50" unit="km/h"/></type>'
        '<type s="50" type="motorway"><speed max="no limit"/></type><type s="80" type="rural"/>'
    )
    lanes = f'<laneSection s="0"><center><lane id="0"/></center><right>{lane}</right></laneSection>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=lanes, extra=kinds)))
    assert network.speed_limit("1", 10.0) == pytest.approx(50 / 3.6)
    assert network.speed_limit("1", 10.0, -1) == pytest.approx(50 / 3.6)
    assert network.speed_limit("1", 30.0, -1) == pytest.approx(13.4112)
    assert network.speed_limit("1", 60.0) == math.inf
    assert network.speed_limit("1", 90.0) is None


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ('<type s="0" type="motorway"/>', 130.0),
        ('<type s="0" type="motorway"><speed max="no limit"/></type>', 130.0),
        ('<type s="0" type="motorway"><speed max="80" unit="km/h"/></type>', 80.0),
        ('<type s="0" type="rural"/>', 100.0),
        ('<type s="0" type="lowSpeed"><speed max="undefined"/></type>', 30.0),
        ('<type s="0" type="town"/>', 50.0),
        ('<type s="50" type="motorway"/>', 50.0),
        ("", 50.0),
    ],
)
def test_usual_speed_is_the_limit_or_that_of_the_road_type(kind: str, expected: float) -> None:
    """Without a limit it is the general one of German law: 50 km/h in towns, 100 outside, 130 recommended, zone 30."""
    network = RoadNetwork.parse(map_xml(road_xml(extra=kind)))
    assert network.usual_speed("1", 10.0) == pytest.approx(expected / 3.6)
    assert network.usual_speed("1", 10.0, -1) == pytest.approx(expected / 3.6)


SIGNALS = (
    '<signals><signal s="90" t="-4" id="7" name="light" dynamic="yes" orientation="+" zOffset="5" country="OpenDRIVE" '
    'type="1000001" subtype="-1" hOffset="0.1"><validity fromLane="-1" toLane="-1"/></signal></signals>'
)


def test_signals_references_and_controllers() -> None:
    other = '<signals><signalReference s="5" t="3" id="7" orientation="-"/></signals>'
    rest = '<controller id="1" name="c"><control signalId="7" type="0"/></controller>'
    network = RoadNetwork.parse(map_xml(road_xml(extra=SIGNALS), road_xml("2", y=50.0, extra=other), rest=rest))
    signal = network.signals["7"]
    assert signal.dynamic
    assert signal.place.validity == ((-1, -1),)
    assert [(place.road, place.s, place.orientation) for place in signal.references] == [("2", 5.0, "-")]
    assert network.controllers["1"].signals == ("7",)
    pose = network.signal_pose(signal)
    assert pose[:4] == pytest.approx((90.0, -4.0, 5.0, math.pi + 0.1))


def test_reference_to_unknown_signal_is_an_error() -> None:
    extra = '<signals><signalReference s="5" t="3" id="9" orientation="-"/></signals>'
    (found,) = road_diagnostics(map_xml(road_xml(extra=extra)))
    assert found == "town.xodr:1: <signalReference> refers to signal '9', which does not exist; correct the id"


def test_signals_with_equal_ids_are_kept_separate() -> None:
    network = RoadNetwork.parse(map_xml(road_xml(extra=SIGNALS), road_xml("2", y=50.0, extra=SIGNALS)))
    assert {key: signal.place.road for key, signal in network.signals.items()} == {"7": "1", "7#2": "2"}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_mutated_file_is_an_error_or_gives_a_usable_network(library: Path, data: st.DataObject) -> None:
    root = etree.parse(str(library / "coop_2.xodr")).getroot()
    elements = [element for element in root.iter() if element.attrib]
    for _ in range(data.draw(st.integers(1, 4))):
        element = elements[data.draw(st.integers(0, len(elements) - 1))]
        if not element.attrib:
            continue
        name = data.draw(st.sampled_from(sorted(map(str, element.attrib))))
        text = data.draw(
            st.sampled_from([None, "", "x", "-1", "0", "nan", "1e400", "99999999999", "0.5", "a'b", "end"])
        )
        if text is None:
            del element.attrib[name]
        else:
            element.set(name, text)
    refused: tuple[Diagnostic, ...] = ()
    try:
        network = RoadNetwork.parse(etree.tostring(root))
    except RoadError as error:
        refused = error.diagnostics
    if refused:
        assert all(diagnostic.message and diagnostic.hint for diagnostic in refused)
        return
    network.locate([0.0, 30.0], [0.0, 5.0])
    for key in list(network.graph)[:8]:
        start = network.roads[key.road].sections[key.section].s
        network.advance(network.location(key.road, key.lane, start), 30.0)


def test_virtual_junction_is_unreachable_from_road_ends() -> None:
    """A driveway leaves road 1 at s = 50. It must be unreachable from the end of road 1."""
    leaves = '<predecessor elementType="road" elementId="1" elementS="50" elementDir="+"/>'
    connection = (
        '<connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start"><laneLink from="-1" to="-1"/>'
        "</connection>"
    )
    virtual = (
        '<junction id="9" name="" type="virtual" mainRoad="1" sStart="45" sEnd="55" orientation="+">'
        f"{connection}</junction>"
    )
    driveway = road_xml("2", x=50.0, y=-2.0, hdg=-1.5, length=20.0, link=leaves, junction="9")
    network = RoadNetwork.parse(map_xml(road_xml("1"), driveway, rest=virtual), "town.xodr")
    assert network.advance(network.location("1", -1, 90.0), 20.0) is None
    (warning,) = network.map_warnings
    assert str(warning) == (
        "town.xodr:1: a road is linked to road '1' between its ends; the link is ignored; "
        "split that road there and connect the parts by a junction"
    )
