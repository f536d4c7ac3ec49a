"""Tests of the warnings of readable road files."""

import math
from pathlib import Path

import pytest
from opendrive_xml import map_xml, road_xml, section_xml

from eidrive_scenario.roads import RoadNetwork, placed_objects

LINE = '<geometry s="{s}" x="{x}" y="{y}" hdg="{h}" length="50"><line/></geometry>'
WIDTH = '<width sOffset="{0}" a="{1}" b="{2}" c="{3}" d="{4}"/>'


def lane(number: int, link: str = "", width: str = WIDTH.format(0, 3.5, 0, 0, 0), kind: str = "driving") -> str:
    return f'<lane id="{number}" type="{kind}"><link>{link}</link>{width}</lane>'


def section(s: float, *right: str) -> str:
    return section_xml(right="".join(right), s=s)


def map_warnings(text: str) -> list[tuple[str, str]]:
    """Return rule and message of each warning."""
    return [(diagnostic.rule, diagnostic.message) for diagnostic in RoadNetwork.parse(text, "town.xodr").map_warnings]


def two_lines(s: float = 50.0, x: float = 50.0, y: float = 0.0, h: float = 0.0) -> str:
    return LINE.format(s=0, x=0, y=0, h=0) + "\n" + LINE.format(s=s, x=x, y=y, h=h)


@pytest.mark.parametrize(
    ("second", "rule", "message"),
    [
        ({"y": 0.3, "x": 50.4}, "geometry-gap", "road '1' jumps by 0.5 m at s = 50 m"),
        ({"s": 50.2}, "geometry-gap", "road '1': the geometry at s = 0 m ends before the next one starts, by 0.2 m"),
        ({"s": 49.8}, "geometry-gap", "road '1': the geometry at s = 0 m overlaps the next one, by 0.2 m"),
        ({"h": 0.02}, "heading-discontinuity", "road '1' has a kink of 0.02 rad at s = 50 m"),
        ({"h": 2 * math.pi - 0.02}, "heading-discontinuity", "road '1' has a kink of 0.02 rad at s = 50 m"),
    ],
)
def test_disconnected_geometries_are_a_warning(second: dict[str, float], rule: str, message: str) -> None:
    assert map_warnings(map_xml(road_xml(geometry=two_lines(**second))))[0] == (rule, message)


def test_geometries_in_one_line_of_the_file_are_compared() -> None:
    """Tools write maps without line breaks."""
    text = map_xml(road_xml(geometry=two_lines(y=1.0).replace("\n", "")))
    assert map_warnings(text) == [("geometry-gap", "road '1' jumps by 1 m at s = 50 m")]


def test_parts_of_one_geometry_give_no_warning() -> None:
    """A poly3 is divided into parts; v = 0.001 u² + 0.00001 u³."""
    bend = '<geometry s="0" x="0" y="0" hdg="0.3" length="100"><poly3 a="0" b="0" c="0.001" d="0.00001"/></geometry>'
    assert map_warnings(map_xml(road_xml(geometry=bend))) == []


@pytest.mark.parametrize("second", [{"y": 0.008}, {"h": 0.0008}, {"h": 2 * math.pi}, {"h": 0.5}, {"s": 50.004}])
def test_rounding_and_corners_give_no_warning(second: dict[str, float]) -> None:
    assert map_warnings(map_xml(road_xml(geometry=two_lines(**second)))) == []


def test_length_that_differs_from_geometry_is_a_warning() -> None:
    text = map_xml(road_xml(length=100.05, geometry=two_lines()))
    assert map_warnings(text) == [
        ("geometry-gap", "road '1' has length 100.05 m, but its geometry ends 0.05 m before that")
    ]


def test_lane_section_that_begins_late_is_a_warning() -> None:
    text = map_xml(road_xml(lanes=section(20, lane(-1))))
    assert map_warnings(text) == [("geometry-gap", "the first <laneSection> of its road begins at s = 20 m")]


def test_warnings_of_one_kind_are_grouped_with_their_lines() -> None:
    text = map_xml(*("\n" + road_xml(str(n), geometry=two_lines(y=1.0)) for n in range(8)))
    (diagnostic,) = RoadNetwork.parse(text, "town.xodr").map_warnings
    assert str(diagnostic) == (
        "town.xodr:3: road '0' jumps by 1 m at s = 50 m; 7 more of such jumps: line 5, 7, 9, 11, …; "
        "start each geometry at the end of its predecessor"
    )


@pytest.mark.parametrize(
    ("width", "message"),
    [
        ("", "has no width"),
        (WIDTH.format(5, 3.5, 0, 0, 0), "has no width before its sOffset 5"),
        (WIDTH.format(0, 2, -0.03, 0, 0), "becomes -1 m wide"),
        # 1 - 6 (ds/100)² + 5 (ds/100)³ has its minimum at 80 m: 1 - 3.84 + 2.56.
        (WIDTH.format(0, 1, 0, -6e-4, 5e-6), "becomes -0.28 m wide"),
        (WIDTH.format(0, 350, 0, 0, 0), "becomes 350 m wide"),
        (WIDTH.format(0, 3.5, 0, 0, 1), "becomes 1e+06 m wide"),
    ],
)
def test_missing_negative_and_implausible_widths_are_warnings(width: str, message: str) -> None:
    text = map_xml(road_xml(lanes=section(0, lane(-1), lane(-2, width=width, kind="shoulder"))))
    assert map_warnings(text) == [("lane-width", f"lane -2 of road '1' (section at s = 0 m) {message}")]


def test_lanes_of_zero_and_vanishing_width_give_no_warning() -> None:
    tapering = WIDTH.format(0, 3.5, -0.035, 0, 0)
    lanes = section(0, lane(-1), lane(-2, width=tapering), lane(-3, width=WIDTH.format(0, *"0000")))
    assert map_warnings(map_xml(road_xml(lanes=lanes))) == []


def test_invalid_lane_links_within_a_road_are_warnings() -> None:
    link = '<successor id="{}"/>'.format
    later = section(60, lane(-1, '<predecessor id="-1"/>'))
    broken = map_warnings(map_xml(road_xml(lanes=section(0, lane(-1), lane(-2, link(-2))) + later)))
    assert broken == [
        (
            "lane-link",
            "lane -2 of road '1' has the successor -2, which the next lane section (s = 60 m) does not have",
        ),
        ("lane-link", "lane -2 of road '1' (section at s = 0 m) has no successor although the road continues"),
    ]
    merging = section(0, lane(-1), lane(-2, width=WIDTH.format(0, 3.0, -0.05, 0, 0))) + later
    assert map_warnings(map_xml(road_xml(lanes=merging))) == []


def test_invalid_lane_links_between_roads_are_warnings() -> None:
    onwards = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    back = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    other = road_xml("2", x=100.0, link=back, lanes=section(0, lane(-1, '<predecessor id="-1"/>')))
    sound = road_xml("1", link=onwards, lanes=section(0, lane(-1, '<successor id="-1"/>')))
    assert map_warnings(map_xml(sound, other)) == []
    loose = road_xml("1", link=onwards, lanes=section(0, lane(-1, '<successor id="-3"/>'), lane(-2)))
    assert map_warnings(map_xml(loose, other)) == [
        ("lane-link", "lane -1 of road '1' has the successor -3, which the start of road '2' does not have"),
        (
            "lane-link",
            "lane -2 of road '1' (section at s = 0 m) has no successor although the road continues in road '2'",
        ),
    ]


def test_gap_between_linked_lanes_is_a_warning() -> None:
    """Reference lines need not meet: a lane of the second road, whose line is further right, continues lane -2."""
    onwards = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    back = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    first = road_xml("1", link=onwards, lanes=section(0, lane(-1), lane(-2, '<successor id="-1"/>')))
    first = first.replace('<lane id="-1" type="driving"', '<lane id="-1" type="shoulder"')
    for y, apart in ((-3.5, ""), (-3.505, ""), (-3.1, "0.4"), (0.0, "3.5")):
        second = road_xml("2", x=100.0, y=y, link=back, lanes=section(0, lane(-1, '<predecessor id="-2"/>')))
        what = f"lane -2 of road '1' and lane -1 of road '2' are linked but their ends are {apart} m apart"
        assert map_warnings(map_xml(first, second)) == ([("geometry-gap", what)] if apart else [])


@pytest.mark.parametrize(
    ("later", "gap"),
    [
        (lane(-1, '<predecessor id="-1"/>'), None),
        (lane(-1, '<predecessor id="-1"/>', WIDTH.format(0, 3.0, 0, 0, 0)), ("-1", "0.25")),
        (lane(-1) + lane(-2, '<predecessor id="-1"/>'), ("-2", "3.5")),
        # A lane divides into two, which together are as wide
        ("".join(lane(-n, '<predecessor id="-1"/>', WIDTH.format(0, 1.75, 0, 0, 0)) for n in (1, 2)), None),
        ("".join(lane(-n, '<predecessor id="-1"/>', WIDTH.format(0, 2.0, 0, 0, 0)) for n in (1, 2)), ("-2", "1.25")),
    ],
)
def test_gap_between_linked_lanes_within_a_road_is_a_warning(later: str, gap: tuple[str, str] | None) -> None:
    lanes = section(0, lane(-1)) + section(60, later)
    message = (
        "lane -1 of road '1' (section at s = 0 m) and lane {} of road '1' (section at s = 60 m) are linked "
        "but their ends are {} m apart"
    )
    gaps = [("geometry-gap", message.format(*gap))] if gap else []
    assert map_warnings(map_xml(road_xml(lanes=lanes))) == gaps


def test_step_of_the_lane_offset_that_renumbered_lanes_undo_is_no_gap() -> None:
    offsets = "".join(f'<laneOffset s="{s}" a="{a}" b="0" c="0" d="0"/>' for s, a in ((0, 0.0), (60, -3.5)))
    two = section(0, lane(-1, kind="border"), lane(-2, '<successor id="-1"/>'))
    assert map_warnings(map_xml(road_xml(lanes=offsets + two + section(60, lane(-1))))) == []


@pytest.mark.parametrize(
    ("shape", "path"),
    [
        ('<paramPoly3 aU="0" bU="30" cU="0" dU="0" aV="0" bV="40" cV="0" dV="0"/>', None),
        ('<paramPoly3 aU="0" bU="36" cU="0" dU="0" aV="0" bV="48" cV="0" dV="0"/>', "60"),
        ('<paramPoly3 pRange="arcLength" aU="0" bU=".6" cU="0" dU="0" aV="0" bV=".8" cV="0" dV="0"/>', None),
        ('<paramPoly3 aU="0" bU="30.03" cU="0" dU="0" aV="0" bV="40.04" cV="0" dV="0"/>', None),
        ('<paramPoly3 pRange="arcLength" aU="0" bU=".6" cU="0" dU="0" aV="0" bV=".9" cV="0" dV="0"/>', "54.0833"),
        # v = 25 p² over u = 50 p: √2 and asinh(1) of a parabola
        ('<paramPoly3 aU="0" bU="50" cU="0" dU="0" aV="0" bV="0" cV="25" dV="0"/>', "57.3897"),
    ],
)
def test_curve_of_another_length_than_stated_is_a_warning(shape: str, path: str | None) -> None:
    geometry = f'<geometry s="0" x="0" y="0" hdg="0" length="50">{shape}</geometry>'
    message = f"the curve of a geometry of road '1' is {path} m long, but its length is 50 m"
    warnings = [("geometry-gap", message)] if path else []
    assert map_warnings(map_xml(road_xml(length=50.0, geometry=geometry))) == warnings


def test_negative_sizes_of_objects_count_as_omitted_with_a_warning() -> None:
    repeat = '<repeat s="0" length="100" distance="50" tStart="6" tEnd="6" widthStart="-1" widthEnd="3"/>'
    objects = "".join(
        f'<object id="{number}" type="pole" s="20" t="-6" length="2" width="2" {sizes}>{more}</object>'
        for number, (sizes, more) in enumerate((('height="-4"', ""), ('radius="-1" height="5"', ""), ("", repeat)))
    )
    network = RoadNetwork.parse(map_xml(road_xml(extra=f"<objects>{objects}</objects>")), "town.xodr")
    (diagnostic,) = network.map_warnings
    assert diagnostic.rule == "object-size"
    assert diagnostic.message == (
        "<object> has height=-4, which counts as omitted; 2 more of negative sizes of objects: line 1, 1"
    )
    sizes = [(placed.length, placed.width, placed.height) for placed in placed_objects(network)]
    assert sizes == [(2.0, 2.0, 0.0), (2.0, 2.0, 5.0), (2.0, 1.5, 0.0), (2.0, 3.0, 0.0)]


@pytest.mark.parametrize(
    ("first", "last", "which"),
    [(-3, -2, "lanes -3 to -2, which do"), (2, 2, "lane 2, which does"), (-3, -1, ""), (1, 1, ""), (0, 0, "")],
)
def test_signal_for_lanes_that_do_not_exist_is_a_warning(first: int, last: int, which: str) -> None:
    """The road has two lanes to the right up to 60 m."""
    signal = (
        '<signal id="7" s="80" t="-5" dynamic="yes" orientation="+" zOffset="2" type="1000001">'
        f'<validity fromLane="{first}" toLane="{last}"/></signal>'
    )
    lanes = section_xml(lane(1), lane(-1) + lane(-2)) + section_xml(lane(1), lane(-1), s=60)
    text = map_xml(road_xml(lanes=lanes, extra=f"<signals>{signal}</signals>"))
    warnings = [message for rule, message in map_warnings(text) if rule == "signal-off-road"]
    assert warnings == [
        f"a signal at s = 80 m of road '1' is valid for {shown} not exist there" for shown in filter(None, [which])
    ]


def test_ignored_lateral_profiles_are_warnings() -> None:
    def profile(*entries: str) -> list[tuple[str, str]]:
        return map_warnings(map_xml(road_xml(extra=f"<lateralProfile>{''.join(entries)}</lateralProfile>")))

    flat, bent = '<shape s="0" t="-4" a="0" b="0" c="0" d="0"/>', '<shape s="0" t="-4" a="0" b="0.02" c="0" d="0"/>'
    assert profile(flat, '<superelevation s="0" a="1.5" b="0" c="0" d="0"/>') == []
    unread = "road '1' has <{}>, which is ignored: its cross section is straight"
    assert profile(flat, bent) == [("road-surface", unread.format("shape"))]
    assert profile('<crossfall side="right" s="0" a="0.02" b="0" c="0" d="0"/>') == [
        ("road-surface", unread.format("crossfall"))
    ]
    assert profile("<crossSectionSurface/>") == [("road-surface", unread.format("crossSectionSurface"))]
    assert profile('<superelevation s="40" a="-4" b="0" c="0" d="0"/>') == [
        ("road-surface", "road '1' is tilted by -4 rad at s = 40 m")
    ]


@pytest.mark.parametrize("temporary_first", [False, True])
def test_temporary_lanes_are_ignored_with_a_warning(temporary_first: bool) -> None:
    """OpenDRIVE 1.9: a road may have a permanent and a temporary layer of lanes, in any order."""
    permanent = map_xml(road_xml("1", lanes=section(0, lane(-1), lane(-2))))
    whole = permanent.partition("<lanes>")[2].partition("</lanes>")[0]
    part = section(20, lane(-1)).replace("<laneSection ", '<laneSection length="30" ')
    layers = [f'<lanes layer="permanent">{whole}</lanes>', f'<lanes layer="temporary">{part}</lanes>']
    text = permanent.replace(f"<lanes>{whole}</lanes>", "".join(reversed(layers) if temporary_first else layers))
    assert text != permanent
    assert map_warnings(text) == [("lane-layer", "road '1' has a temporary layer of lanes, which is ignored")]
    roads = RoadNetwork.parse(text.encode())
    assert [one.s for one in roads.road("1").sections] == [0.0]
    assert map_warnings(text.replace(layers[0], "")) == []


@pytest.mark.parametrize(("kind", "warnings"), [("driving", 1), ("sidewalk", 0)])
def test_direction_that_changes_along_an_id_is_a_warning(kind: str, warnings: int) -> None:
    """The direction of an id is that of its first lane for cars."""
    turned = lane(-1).replace("<lane ", '<lane direction="reversed" ')
    text = map_xml(road_xml("1", lanes=section(0, lane(-1, kind=kind)) + section(40, turned)))
    message = (
        "lane -1 of road '1' (section at s = 40 m) has the direction of lane -1 in an earlier section, not its own"
    )
    assert map_warnings(text).count(("lane-direction", message)) == len(map_warnings(text)) == warnings


def test_invalid_connections_are_warnings() -> None:
    into = '<successor elementType="junction" elementId="9"/>'
    through = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    arm = road_xml("1", link=into, lanes=section(0, lane(-1)))
    inner = road_xml("2", x=100.0, junction="9", link=through, lanes=section(0, lane(-1, '<predecessor id="-1"/>')))

    def junction(incoming: str, connecting: str, links: str) -> str:
        connection = f'<connection id="0" incomingRoad="{incoming}" connectingRoad="{connecting}" contactPoint="start">'
        return f'<junction id="9" name="">{connection}{links}</connection></junction>'

    fitting = '<laneLink from="-1" to="-1"/>'
    assert map_warnings(map_xml(arm, inner, rest=junction("1", "2", fitting))) == []
    wrong = map_warnings(map_xml(arm, inner, rest=junction("1", "2", '<laneLink from="-4" to="-1"/>')))
    what = "connection '0' of junction '9' links lane -4 of road '1', which does not exist there"
    assert wrong == [("junction-connection", what)]
    against = map_xml(arm, inner, rest=junction("1", "2", fitting)).replace('rule="RHT"', 'rule="LHT"')
    what = "connection '0' of junction '9' is opposite to the traffic of roads '1' and '2'"
    assert map_warnings(against) == [("junction-connection", what)]
    two_way = against.replace('type="driving"', 'type="driving" direction="both"')
    assert map_warnings(two_way) == []
    missing = map_warnings(map_xml(arm, inner, rest=junction("1", "7", fitting)))
    assert ("junction-connection", "<connection> refers to road '7', which does not exist") in missing
    elsewhere = road_xml("3", y=50.0, lanes=section(0, lane(-1)))
    outside = {message for _, message in map_warnings(map_xml(arm, inner, elsewhere, rest=junction("3", "3", fitting)))}
    assert "connection '0' of junction '9' comes from road '3', which does not end at the junction" in outside
    assert "connection '0' of junction '9' uses road '3', which does not belong to the junction" in outside
    closed = map_warnings(map_xml(arm, road_xml("2", x=100.0, junction="9"), rest=junction("1", "2", "")))
    assert closed == []  # Without a <laneLink>, lanes of the same id are connected.


def test_links_bypass_a_section_of_zero_length() -> None:
    """The section is omitted; Town06 has such a section, which renumbers its lanes."""
    first = section(0, lane(-1, '<successor id="-2"/>'), lane(-2, '<successor id="-3"/>'))
    none = section(60, lane(-1), lane(-2, '<successor id="-1"/>'), lane(-3, '<successor id="-2"/>'))
    last = section(60.0000004, lane(-1, '<predecessor id="-2"/>'), lane(-2, '<predecessor id="-3"/>'))
    network = RoadNetwork.parse(map_xml(road_xml(lanes=first + none + last)), "town.xodr")
    assert network.map_warnings == ()
    for number in (-1, -2):
        assert network.roads["1"].sections[0].lanes[number].successors == (number,)


def test_section_without_lanes_ends_the_lanes_beside_it() -> None:
    """RoadRunner exports its georeference as a road with the center lane only."""
    reference = road_xml("reference", y=50.0, lanes=section(0))
    text = map_xml(reference, road_xml("1", lanes=section(0, lane(-1)) + section(60)))
    message = "<laneSection> has no lane except the center lane, so vehicles cannot drive there"
    first, *others = map_warnings(text)
    assert first == ("empty-lane-section", f"{message}; 1 more of lane sections with only the center lane: line 1")
    assert {rule for rule, _ in others} == {"lane-link"}
    network = RoadNetwork.parse(text)
    assert list(network.lane_ids("1", 80.0)) == list(network.lane_ids("reference", 50.0)) == []
    assert network.advance(network.location("1", -1, 50.0), 9.0) is not None
    assert network.advance(network.location("1", -1, 50.0), 11.0) is None


@pytest.mark.exhaustive
def test_corpus_maps_have_only_known_warnings(corpora: Path) -> None:
    """Each map has at most one warning per kind. The expected ones were verified in the files."""
    found: dict[tuple[str, str], list[int | None]] = {}
    for file in sorted(corpora.rglob("*.xodr")):
        for diagnostic in RoadNetwork.load(file).map_warnings:
            found.setdefault((file.name, diagnostic.rule), []).append(diagnostic.line)
    assert found == {
        ("SampleDatabase.xodr", "lane-width"): [1807, 1807],
        ("SampleDatabase.xodr", "geometry-gap"): [3237, 3237],
        ("Town03.xodr", "lane-link"): [7913, 8040],
        ("Town06.xodr", "geometry-gap"): [14443],
        ("parking_demo.xodr", "lane-link"): [564],
        ("parking_demo.xodr", "object-off-road"): [301],
    }
