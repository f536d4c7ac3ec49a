"""Tests of road surfaces and markings."""

import math
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.roads import KINDS, RoadNetwork, SurfaceMesh, outlines, placed_objects, surface_meshes


def area(mesh: SurfaceMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def by_kind(network: RoadNetwork) -> dict[str, SurfaceMesh]:
    return {mesh.kind: mesh for mesh in surface_meshes(network)}


def marked(kind: str, color: str = "white") -> str:
    mark = f'<roadMark sOffset="0" type="{kind}" color="{color}" width="0.2"/>'
    return section_xml(right=lane_xml(-1, 4), center=mark)


def test_straight_lane_has_few_triangles() -> None:
    mesh = by_kind(RoadNetwork.parse(map_xml(road_xml(lanes=marked("none")))))["driving"]
    assert area(mesh) == pytest.approx(400.0)
    assert len(mesh.faces) <= 12
    assert np.diff(np.unique(mesh.vertices[:, 0])).max() <= 25.0
    assert mesh.color == KINDS["driving"]


def test_bend_is_approximated_to_one_centimeter() -> None:
    length = 20 * math.pi
    bend = f'<geometry s="0" x="0" y="0" hdg="0" length="{length!r}"><arc curvature="0.05"/></geometry>'
    mesh = by_kind(RoadNetwork.parse(map_xml(road_xml(length=length, geometry=bend, lanes=marked("none")))))["driving"]
    assert area(mesh) == pytest.approx(math.pi / 2 * (24.0**2 - 20.0**2), rel=2e-3)


def test_road_marks_have_specified_length_and_width() -> None:
    expected = {"solid": 20.0, "broken": 0.2 * 34, "solid solid": 40.0, "broken solid": 20.0 + 0.2 * 34}
    for kind, size in expected.items():
        mesh = by_kind(RoadNetwork.parse(map_xml(road_xml(lanes=marked(kind, "yellow")))))["marking_yellow"]
        assert area(mesh) == pytest.approx(size), kind
        assert mesh.vertices[:, 2].min() > 0.0


def test_broken_solid_center_line_has_its_broken_line_left() -> None:
    mesh = by_kind(RoadNetwork.parse(map_xml(road_xml(lanes=marked("broken solid")))))["marking_white"]
    left = mesh.vertices[mesh.faces][np.mean(mesh.vertices[mesh.faces][:, :, 1], axis=1) > 0.0]
    assert left[:, :, 0].max() - left[:, :, 0].min() == pytest.approx(100.0, abs=1.1)
    assert len(left) == 2 * 12


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('<explicit><line sOffset="2" length="5" tOffset="0.3" width="0.4"/></explicit>', [(12.0, 17.0, 0.1, 0.5)]),
        (
            '<type name="" width="0.2"><line length="5" space="95" tOffset="-0.3" sOffset="0" width="0.2"/>'
            '<line length="0" space="0" tOffset="0.3" sOffset="0" width="0.2"/></type>',
            [(10.0, 15.0, -0.4, -0.2), (10.0, 100.0, 0.2, 0.4)],
        ),
        (
            '<type name="" width="0.2"><line length="90" space="0" tOffset="0" sOffset="0"/></type>'
            '<explicit><line sOffset="89" length="5" tOffset="0.5"/></explicit>',
            [(10.0, 100.0, -0.1, 0.1), (99.0, 100.0, 0.4, 0.6)],
        ),
    ],
    ids=["explicit", "line of length 0 beside another one", "type and explicit"],
)
@pytest.mark.parametrize("kind", ["custom", "broken"])
def test_lines_of_a_road_mark_are_drawn_where_they_are_specified(
    kind: str, lines: str, expected: list[tuple[float, float, float, float]]
) -> None:
    """The mark of lane 0 begins at 10 m. A line of a single dash is relative to it (OpenDRIVE 1.8, explicit)."""
    mark = f'<roadMark sOffset="10" type="{kind}" width="0.2">{lines}</roadMark>'
    roads = RoadNetwork.parse(map_xml(road_xml(lanes=section_xml(right=lane_xml(-1, 4), center=mark))))
    mesh = by_kind(roads)["marking_white"]
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    for begin, end, right, left in expected:
        inside = (y > right - 1e-6) & (y < left + 1e-6)
        assert (x[inside].min(), x[inside].max()) == pytest.approx((begin, end))
    widths = sum((end - begin) * (left - right) for begin, end, right, left in expected)
    assert area(mesh) == pytest.approx(widths)


@pytest.mark.parametrize("name", ["coop_1", "coop_2"])
def test_ground_faces_point_upwards(library: Path, name: str) -> None:
    for mesh in surface_meshes(RoadNetwork.load(library / f"{name}.xodr")):
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        assert np.all(np.isfinite(mesh.vertices))
        if mesh.kind != "curb":
            assert np.all(normal[:, 2] > -1e-9), mesh.kind


def test_crosswalk_is_striped_and_curb_is_raised(library: Path) -> None:
    network = RoadNetwork.load(library / "coop_2.xodr")
    meshes = by_kind(network)
    assert meshes["sidewalk"].vertices[:, 2] == pytest.approx(0.12)
    assert set(np.round(meshes["curb"].vertices[:, 2], 6)) == {0.0, 0.12}
    crosswalk = next(p for p in placed_objects(network) if p.object.type == "crosswalk" and p.object.road == "3")
    (ground,) = outlines(network, crosswalk)
    assert ground[:, 1].min() == pytest.approx(24.3)
    assert ground[:, 1].max() == pytest.approx(27.3)
    assert np.ptp(ground[:, 0]) == pytest.approx(2 * (3.5 + 3.5 + 0.5 + 0.63))


def test_repeated_object_is_placed_along_the_road() -> None:
    objects = (
        '<objects><object id="1" type="pole" s="0" t="0" radius="0.1" height="1">'
        '<repeat s="10" length="40" distance="20" tStart="4" tEnd="6" heightStart="1" heightEnd="2" '
        'zOffsetStart="0" zOffsetEnd="0"/></object>'
        '<object id="2" type="barrier" s="0" t="0" height="1" width="0.3"><repeat s="0" length="12" distance="0" '
        'tStart="5" tEnd="5" heightStart="1" heightEnd="1" zOffsetStart="0" zOffsetEnd="0"/></object></objects>'
    )
    placed = list(placed_objects(RoadNetwork.parse(map_xml(road_xml(extra=objects)))))
    posts, parts = np.array([(p.pose.x, p.pose.y, p.height) for p in placed[:3]]), placed[3:]
    assert posts == pytest.approx(np.array([(10, 4, 1), (30, 5, 1.5), (50, 6, 2)]))
    assert np.array([(p.pose.x, p.length) for p in parts]) == pytest.approx(np.array([(2, 4), (6, 4), (10, 4)]))


@pytest.mark.parametrize(
    ("curvature", "t", "detached", "length"),
    [
        (0.02, (-8.0, -8.0), "false", 10 * 2 * 58.0 * math.sin(2.5 / 50.0)),
        (0.0, (0.0, -20.0), "false", math.hypot(50.0, 20.0)),
        (0.02, (-8.0, -8.0), "true", 2 * 58.0 * math.sin(0.5)),
    ],
    ids=["bend of 50 m radius", "oblique", "straight beside a bend"],
)
def test_parts_of_a_continuous_object_meet(
    curvature: float, t: tuple[float, float], detached: str, length: float
) -> None:
    """OpenDRIVE 1.8, table 87: with distance 0 the object is a continuous feature. Ten parts are chords of the arc."""
    repeat = (
        f'<repeat s="0" length="50" distance="0" tStart="{t[0]}" tEnd="{t[1]}" detachFromReferenceLine="{detached}"/>'
    )
    rail = f'<objects><object id="1" type="barrier" s="0" t="0" height="1" width="0.3">{repeat}</object></objects>'
    road = road_xml(length=50.0, extra=rail).replace("<line/>", f'<arc curvature="{curvature}"/>')
    parts = list(placed_objects(RoadNetwork.parse(map_xml(road))))
    along = np.array([(math.cos(part.pose.h), math.sin(part.pose.h)) for part in parts])
    along *= np.array([[0.5 * part.length] for part in parts])
    centers = np.array([part.pose[:2] for part in parts])
    assert (centers + along)[:-1] == pytest.approx((centers - along)[1:])
    assert (centers - along)[0] == pytest.approx((0.0, t[0]))
    assert sum(part.length for part in parts) == pytest.approx(length)


@pytest.mark.parametrize(
    ("size", "repeat", "expected"),
    [
        ('radius="0.5"', "", [1.0, 1.0, 1.0]),
        ('radius="0.5"', 'radiusStart="1" radiusEnd="2"', [2.0, 3.0, 4.0]),
        ('length="4" width="2"', "", [4.0, 4.0, 4.0]),
        ('length="4" width="2"', 'lengthStart="2" lengthEnd="6"', [2.0, 4.0, 6.0]),
    ],
)
def test_repeated_objects_have_the_size_of_object_or_repetition(size: str, repeat: str, expected: list[float]) -> None:
    """OpenDRIVE 1.5: values of the repetition override those of the object; a radius is half of length and width."""
    objects = (
        f'<objects><object id="1" type="tree" s="0" t="5" height="3" {size}>'
        f'<repeat s="10" length="40" distance="20" {repeat}/></object></objects>'
    )
    placed = list(placed_objects(RoadNetwork.parse(map_xml(road_xml(extra=objects)))))
    assert [one.length for one in placed] == pytest.approx(expected)
    assert [one.width for one in placed] == pytest.approx(expected if "radius" in size else [2.0, 2.0, 2.0])


@pytest.mark.parametrize("size", ["width", "height", "length", "radius"])
def test_repeated_object_that_grows_from_nothing_starts_without_one(size: str) -> None:
    """OpenDRIVE 1.8: sizes of the repetition override those of the object, linearly from its start to its end."""
    objects = (
        '<objects><object id="1" type="tree" s="0" t="5" length="9" width="9" height="9">'
        f'<repeat s="10" length="40" distance="20" {size}Start="0" {size}End="2"/></object></objects>'
    )
    placed = list(placed_objects(RoadNetwork.parse(map_xml(road_xml(extra=objects)))))
    assert [one.pose.x for one in placed] == pytest.approx([30.0, 50.0])
    values = [one.length / 2.0 if size == "radius" else getattr(one, size) for one in placed]
    assert values == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize(("length", "distance"), [(0.6, 0.2), (17.4, 5.8), (40.0, 20.0)])
def test_last_repetition_at_a_multiple_of_the_distance_is_placed(length: float, distance: float) -> None:
    """In floating point 0.6 / 0.2 and 17.4 / 5.8 are below 3."""
    repeat = f'<repeat s="10" length="{length}" distance="{distance}"/>'
    objects = f'<objects><object id="1" type="pole" s="0" t="5" radius="0.1" height="1">{repeat}</object></objects>'
    placed = list(placed_objects(RoadNetwork.parse(map_xml(road_xml(extra=objects)))))
    assert len(placed) == round(length / distance) + 1
    assert placed[-1].pose.x == pytest.approx(10.0 + length)


def test_cycle_lanes_in_junctions_are_below_driving_lanes() -> None:
    both = (
        '<laneSection s="0"><center><lane id="0"/></center><right>'
        '<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>'
        '<lane id="-2" type="biking"><width sOffset="0" a="1" b="0" c="0" d="0"/></lane></right></laneSection>'
    )
    inside = by_kind(RoadNetwork.parse(map_xml(road_xml(lanes=both, junction="9"), rest='<junction id="9" name=""/>')))
    assert np.unique(inside["biking"].vertices[:, 2]) == pytest.approx([-0.01])
    assert inside["junction"].vertices[:, 2].max() == 0.0
    outside = by_kind(RoadNetwork.parse(map_xml(road_xml(lanes=both))))
    assert np.unique(outside["biking"].vertices[:, 2]) == pytest.approx([0.0])
