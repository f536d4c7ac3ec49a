"""Signals and objects of the map in OSI ground truth, read by osi-python."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import object_xml, road_file_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml
from written_recording import view, write_run

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.osi.ground_truth import GroundTruthBuilder
from eidrive_scenario.export.osi.schemas import Osi
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.recording.frame import Frame


def street(*, signals: str = "", objects: str = "") -> str:
    """Return a street of 100 m along x with a lane of 3.5 m in each direction; lane -1 drives along x."""
    return map_xml(road_xml(extra=f"<objects>{objects}</objects><signals>{signals}</signals>"))


def truths(road: str) -> list[Any]:
    """Return the messages of two frames."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "street.xodr"
        path.write_text(road)
        run = write_run(Path(folder), [Frame(view({"A": {}}, tick)) for tick in range(2)], road=path)
        return list(map(GroundTruthBuilder(Osi(), run).build, run.frames()))


def signal(number: str, kind: str, more: str = "", *, dynamic: str = "no", validity: str = "", s: float = 50) -> str:
    box = f's="{s}" t="-4" zOffset="2" width="0.6" height="0.6"'
    return f'<signal id="{number}" type="{kind}" dynamic="{dynamic}" {box} {more}>{validity}</signal>'


def valid(first: int, last: int) -> str:
    return f'<validity fromLane="{first}" toLane="{last}"/>'


def lanes(truth: Any, assigned: Any) -> list[str]:
    names = {lane.id.value: lane.source_reference[0].identifier[2] for lane in truth.lane}
    return [names[number.value] for number in assigned]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ((4.0, 5.0, 0.0), {0: "START", 4: "END", 9: "START", 13: "END", 18: "START", 20: "END"}),
        ((4.0, 5.0, 3.0), {0: "GAP", 3: "START", 7: "END", 12: "START", 16: "END", 20: "GAP"}),
        (None, {0: "START", 3: "END", 9: "START", 12: "END", 18: "START", 20: "END"}),
    ],
)
def test_dashes_of_broken_lines_are_points(
    pattern: tuple[float, float, float] | None, expected: dict[int, str]
) -> None:
    """LaneBoundary: for dashed lines, one point "has to be at the start and another at the end" of each dash.

    Dashes of 4 m with spaces of 5 m begin at sOffset on the road of 20 m; by default they have 3 and 6 m.
    """
    dash = '<type name="broken"><line length="{}" space="{}" sOffset="{}" tOffset="0" width="0.12"/></type>'
    lines = "" if pattern is None else dash.format(*pattern)
    mark = f'<roadMark sOffset="0" type="broken" color="white" width="0.12">{lines}</roadMark>'
    truth, _ = truths(map_xml(road_xml(length=20.0, lanes=lanes_xml(0, 1, more=mark))))
    (edge,) = (one for one in truth.lane_boundary if one.classification.type == one.Classification.TYPE_DASHED_LINE)
    assert edge.boundary_line[0].width == 0.12
    x = [point.position.x for point in edge.boundary_line]
    names = [point.Dash.Name(point.dash).removeprefix("DASH_") for point in edge.boundary_line]
    shown = {round(at): name for at, name in zip(x, names, strict=True) if name in ("START", "END") or at in (0, 20)}
    assert x == sorted(x)
    assert shown == expected
    for at, name in zip(x, names, strict=True):
        before = max(place for place in expected if place <= at + 1e-9)
        if abs(at - before) > 1e-9:
            assert name == ("CONTINUE" if expected[before] == "START" else "GAP")


@pytest.mark.parametrize("kind", ["solid", "none", "curb"])
def test_boundaries_that_are_not_broken_have_no_dashes(kind: str) -> None:
    mark = f'<roadMark sOffset="0" type="{kind}" color="white" width="0.12"/>'
    truth, _ = truths(map_xml(road_xml(length=20.0, lanes=lanes_xml(0, 1, more=mark))))
    points = [point for edge in truth.lane_boundary for point in edge.boundary_line]
    assert not any(point.HasField("dash") for point in points)
    assert any(point.HasField("width") for point in points) == (kind == "solid")


@pytest.mark.parametrize(
    ("orientation", "validity", "expected"),
    [("+", "", ["-1"]), ("-", "", ["1"]), ("none", "", ["1", "-1"]), ("none", valid(1, 1), ["1"])],
)
@pytest.mark.parametrize(("dynamic", "kind"), [("yes", "1000001"), ("no", "206")])
def test_signals_are_assigned_to_the_lanes_of_their_validity(
    dynamic: str, kind: str, orientation: str, validity: str, expected: list[str]
) -> None:
    """OpenDRIVE: orientation + is valid for traffic along s, by default for all lanes in this direction."""
    text = signal("7", kind, f'orientation="{orientation}"', dynamic=dynamic, validity=validity)
    truth, _ = truths(street(signals=text))
    shown = truth.traffic_light if dynamic == "yes" else [sign.main_sign for sign in truth.traffic_sign]
    assert len(shown) == (3 if dynamic == "yes" else 1)
    assert all(lanes(truth, one.classification.assigned_lane_id) == expected for one in shown)


@pytest.mark.parametrize(
    ("kind", "subtype", "icon", "count"),
    [
        ("1000001", "-1", "NONE", 3),
        ("1.000.001", "-1", "NONE", 3),
        ("1000002", "-1", "PEDESTRIAN", 2),
        ("1.000.002", "-1", "PEDESTRIAN", 2),
        ("1000013", "-1", "BICYCLE", 2),
        ("1000011", "10", "ARROW_LEFT", 3),
        ("1.000.011", "20", "ARROW_RIGHT", 3),
        ("1000011", "30", "ARROW_STRAIGHT_AHEAD", 3),
    ],
)
def test_icons_of_lights_are_those_of_the_catalog(kind: str, subtype: str, icon: str, count: int) -> None:
    """The OpenDRIVE signal catalog prints its numbers with dots; files have them with and without."""
    truth, _ = truths(street(signals=signal("7", kind, f'subtype="{subtype}"', dynamic="yes")))
    icons = [lamp.classification.Icon.Name(lamp.classification.icon) for lamp in truth.traffic_light]
    assert icons == [f"ICON_{icon}"] * count


def test_signals_of_one_id_are_different_objects() -> None:
    """Some maps use an id twice. In OSI it is the source of both, whose own identifiers are unique."""
    text = "".join(signal("7", kind, dynamic=dynamic, s=s) for kind, dynamic, s in TWICE)
    truth, _ = truths(street(signals=text))
    numbers = [one.id.value for one in (*truth.traffic_light, *truth.traffic_sign, *truth.lane, *truth.lane_boundary)]
    assert len(truth.traffic_light) == 6
    assert len(truth.traffic_sign) == 2
    assert len(set(numbers)) == len(numbers)
    assert {sign.source_reference[0].identifier[0] for sign in truth.traffic_sign} == {"7"}


TWICE = [("1000001", "yes", 20.0), ("1000001", "yes", 30.0), ("205", "no", 40.0), ("205", "no", 50.0)]


def test_sign_faces_its_traffic_with_code_and_value() -> None:
    """The plate of 0.6 m is 2 m above the road at (50, -4), 8 cm before the center of its post, and faces west.

    osi_trafficsign.proto: StVO 274 is TYPE_SPEED_LIMIT_BEGIN; the code is the type of OpenDRIVE.
    """
    text = signal("7", "274", 'orientation="+" subtype="50" country="DE" value="50" unit="km/h" text="zone"')
    first, second = truths(street(signals=text))
    assert not second.traffic_sign
    (sign,) = first.traffic_sign
    base, data = sign.main_sign.base, sign.main_sign.classification
    assert (base.position.x, base.position.y, base.position.z) == pytest.approx((49.92, -4.0, 2.3))
    assert (base.dimension.width, base.dimension.height) == (0.6, 0.6)
    assert abs(base.orientation.yaw) == pytest.approx(math.pi)
    assert data.type == data.TYPE_SPEED_LIMIT_BEGIN
    assert (data.country, data.code, data.sub_code) == ("DE", "274", "50")
    assert (data.value.value, data.value.value_unit, data.value.text) == (
        50.0,
        data.value.UNIT_KILOMETER_PER_HOUR,
        "zone",
    )
    assert data.variability == sign.VARIABILITY_FIXED
    assert sign.source_reference[0].identifier == ["7"]


@pytest.mark.parametrize(
    ("country", "kind", "name"), [("OpenDRIVE", "206", "STOP"), ("SE", "206", "OTHER"), ("DE", "999", "OTHER")]
)
def test_type_of_sign_depends_on_its_country(country: str, kind: str, name: str) -> None:
    """osi_trafficsign.proto: TYPE_UNKNOWN "must not be used in ground truth"."""
    truth, _ = truths(street(signals=signal("7", kind, f'country="{country}" subtype="-1" value="-1"')))
    data = truth.traffic_sign[0].main_sign.classification
    assert data.Type.Name(data.type) == f"TYPE_{name}"
    assert not data.HasField("sub_code")
    assert not data.HasField("value")


def object_text(number: str, kind: str, more: str, inside: str = "") -> str:
    return f'<object id="{number}" type="{kind}" s="50" t="10" zOffset="1" {more}>{inside}</object>'


def test_stationary_object_has_box_type_and_source() -> None:
    """The base of the building of 8 x 4 x 6 m is 1 m above the road at (50, 10), so its center is 4 m above it."""
    first, second = truths(street(objects=object_text("h", "building", 'length="8" width="4" height="6" hdg="0.5"')))
    assert not second.stationary_object
    (house,) = first.stationary_object
    base = house.base
    assert (base.position.x, base.position.y, base.position.z) == pytest.approx((50.0, 10.0, 4.0))
    assert (base.dimension.length, base.dimension.width, base.dimension.height) == (8.0, 4.0, 6.0)
    assert base.orientation.yaw == pytest.approx(0.5)
    assert not base.base_polygon
    assert house.classification.type == house.Classification.TYPE_BUILDING
    assert house.source_reference[0].type == "net.asam.opendrive"
    assert house.source_reference[0].identifier == ["object", "h"]


@pytest.mark.parametrize("step", [1, -1], ids=["counterclockwise", "clockwise"])
def test_outline_is_polygon_around_the_box_center(step: int) -> None:
    """BaseStationary: "The polygon is defined counter-clockwise"; its origin is the center of the bounding box.

    The L of 6 x 4 m is turned by 90°: its box center (3, 2) is at (50 - 2, 10 + 3). Its height of 3 m is on 1 m.
    """
    outline = [(0, 0), (6, 0), (6, 2), (2, 2), (2, 4), (0, 4)][::step]
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="3"/>' for u, v in outline)
    text = object_text("l", "none", f'hdg="{math.pi / 2}"', f"<outline>{corners}</outline>")
    ((one,), _) = (truth.stationary_object for truth in truths(street(objects=text)))
    base = one.base
    assert (base.position.x, base.position.y, base.position.z) == pytest.approx((48.0, 13.0, 2.5))
    assert (base.dimension.length, base.dimension.width, base.dimension.height) == pytest.approx((6.0, 4.0, 3.0))
    polygon = [(round(point.x, 6), round(point.y, 6)) for point in base.base_polygon]
    expected = [(-3, -2), (3, -2), (3, 0), (-1, 0), (-1, 2), (-3, 2)]
    assert sorted(polygon) == sorted(expected)
    area = sum(x * w - z * y for (x, y), (z, w) in zip(polygon, [*polygon[1:], polygon[0]], strict=True)) / 2
    assert area == pytest.approx(16.0)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("tree", "TREE"),
        ("pole", "POLE"),
        ("streetLamp", "EMITTING_STRUCTURE"),
        ("barrier", "BARRIER"),
        ("wall", "WALL"),
        ("gantry", "OVERHEAD_STRUCTURE"),
        ("vegetation", "VEGETATION"),
        ("obstacle", "OTHER"),
    ],
)
def test_type_of_object_is_that_of_its_kind(kind: str, name: str) -> None:
    text = object_text("7", kind, 'length="1" width="1" height="2"', '<repeat s="10" length="20" distance="10"/>')
    objects = truths(street(objects=text))[0].stationary_object
    assert [one.base.position.x for one in objects] == [10.0, 20.0, 30.0]
    assert len({one.id.value for one in objects}) == 3
    assert {one.classification.Type.Name(one.classification.type) for one in objects} == {f"TYPE_{name}"}


@pytest.mark.parametrize("kind", ["crosswalk", "parkingSpace", "roadMark"])
def test_painted_areas_are_no_stationary_objects(kind: str) -> None:
    """osi_object.proto: StationaryObject "excludes traffic lights, traffic signs and road marking"."""
    text = object_text("7", kind, 'length="4" width="2" height="0"')
    assert not truths(street(objects=text))[0].stationary_object


def test_object_below_minimum_height_is_no_stationary_object() -> None:
    """Objects lower than 0.1 m are painted in the simulation, too."""
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="0.05"/>' for u, v in ((0, 0), (4, 0), (4, 2)))
    text = object_text("7", "trafficIsland", "", f"<outline>{corners}</outline>")
    assert not truths(street(objects=text))[0].stationary_object


def test_road_object_that_is_an_entity_is_no_stationary_object(tmp_path: Path) -> None:
    box = object_text("gate", "barrier", 'length="4" width="1" height="1"')
    road = tmp_path / "street.xodr"
    road.write_text(street(objects=box + box.replace('"gate"', '"fixed"')))
    gate = '<ScenarioObject name="Gate"><ExternalObjectReference name="gate"/></ScenarioObject>'
    scenario = scenario_xml(
        entities=object_xml("Ego") + gate,
        init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 20))),
        stop=end_xml(0.1),
        road=road_file_xml(road),
    )
    result = run_and_save(scenario, out=tmp_path / "run")
    assert result.recording is not None
    run = open_run(result.recording)
    first = GroundTruthBuilder(Osi(), run).build(next(iter(run.frames())))
    assert [one.source_reference[0].identifier[1] for one in first.moving_object] == ["Ego", "Gate"]
    assert [one.source_reference[0].identifier[1] for one in first.stationary_object] == ["fixed"]
