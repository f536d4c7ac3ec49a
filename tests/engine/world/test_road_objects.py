"""Tests of road objects: bodies, collisions and occlusion."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import elevation_xml, lanes_xml, map_xml, road_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.objects import crosswalks
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.road_objects import RoadObjectBody, road_object_bodies, signal_heads


def network(*objects: str, signals: str = "", heading: float = 0.0, profiles: str = "") -> RoadNetwork:
    """Return a street along x whose only lane has its center at y = -2, with objects by their attributes."""
    listed = "".join(f'<object id="{number}" hdg="{heading}" {one}</object>' for number, one in enumerate(objects))
    extra = f"<objects>{listed}</objects><signals>{signals}</signals>"
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, profiles=profiles, lanes=lanes_xml(0, 1, 4), extra=extra)))


def only(*objects: str) -> RoadObjectBody:
    (found,) = road_object_bodies(network(*objects))
    return found


def signal(rest: str, kind: str = "206", dynamic: str = "no") -> str:
    return f'<signal id="7" name="" type="{kind}" subtype="-1" dynamic="{dynamic}" orientation="+" {rest}/>'


# Bodies of objects


def test_object_sizes_are_those_of_the_map_or_defaults() -> None:
    tree = only('type="tree" name="oak" s="50" t="-8" zOffset="0" length="5" width="5" height="8">')
    assert (tree.name, tree.kind, tree.solid) == ("oak", "tree", True)
    assert (tree.pose.x, tree.pose.y, tree.height) == (50.0, -8.0, 8.0)
    assert tree.radius == pytest.approx(0.4)
    pole = only('type="pole" s="50" t="-8" zOffset="0">')
    assert (pole.name, pole.height, pole.radius) == ("pole 0", 4.0, 0.06)
    round_one = only('type="obstacle" s="50" t="-8" zOffset="0" radius="0.4" height="1">')
    assert (round_one.radius, round_one.height) == (0.4, 1.0)


@pytest.mark.parametrize(
    "outline", ["", '<cornerLocal u="0" v="0" z="0"/>', '<cornerRoad s="1" t="2"/><cornerRoad s="3" t="2"/>']
)
@pytest.mark.parametrize("kind", ["barrier", "building"])
def test_outline_with_less_than_three_corners_is_ignored(kind: str, outline: str) -> None:
    roads = network(
        f'type="{kind}" s="50" t="-9" zOffset="0" length="6" width="4" height="3"><outline>{outline}</outline>'
    )
    with World(roads) as world:
        hits = world.raycast([[50.0, -2.0, 1.0]], [[50.0, -20.0, 1.0]])
    assert hits.position[0] == pytest.approx([50.0, -7.0, 1.0], abs=1e-3)


@pytest.mark.parametrize(
    "attributes",
    [
        'type="crosswalk" s="50" t="-2" zOffset="0" length="4" width="3" height="0">',
        'type="roadMark" s="50" t="-2" zOffset="0" length="4" width="3" height="0.01">',
        'type="parkingSpace" s="50" t="-6" zOffset="0" length="5" width="2.5" height="4">',
        'type="building" s="50" t="-20" zOffset="0" length="5" width="5" height="9">',
        'type="-1" name="Speed_30" s="50" t="-5" zOffset="0" length="0" width="0" height="0">',
        'type="barrier" s="50" t="-5" zOffset="0" length="5" width="0.3" height="0.05">',
    ],
)
def test_paint_buildings_and_flat_objects_have_no_body(attributes: str) -> None:
    assert list(road_object_bodies(network(attributes))) == []


@pytest.mark.parametrize(
    ("t", "size", "height", "kind"),
    [
        (-8, 2, 1, "obstacle"),
        (-7, 8, 12, "tree"),
        (-7, 8, 4, "obstacle"),
        (-2, 8, 12, "obstacle"),
        (-9, 8, 12, "obstacle"),
    ],
)
def test_high_object_of_unknown_type_over_a_lane_is_a_tree(t: float, size: float, height: float, kind: str) -> None:
    """The lane is 4 m wide and ends at t = -4 m."""
    text = f'type="none" s="50" t="{t}" zOffset="0" length="{size}" width="{size}" height="{height}">'
    assert only(text).kind == kind


@pytest.mark.parametrize("kind", ["obstacle", "none"])
def test_outline_determines_position_and_size(kind: str) -> None:
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="1.2"/>' for u, v in ((0, 0), (6, 0), (6, 2), (0, 2)))
    piece = only(f'type="{kind}" s="50" t="-10" zOffset="0"><outline>{corners}</outline>')
    assert (piece.pose.x, piece.pose.y, piece.length, piece.width, piece.height) == (53.0, -9.0, 6.0, 2.0, 1.2)


LOCAL = [f'<cornerLocal u="{u}" v="{v}" z="0" height="1.2"/>' for u, v in ((0, 0), (6, 0), (6, 2), (0, 2))]
ON_ROAD = [f'<cornerRoad s="{50 + u}" t="{v - 10}" dz="0" height="1.2"/>' for u, v in ((0, 0), (6, 0), (6, 2), (0, 2))]


def test_outline_replaces_height_and_base_of_the_object() -> None:
    """OpenDRIVE: an outline supersedes the bounding box; z and dz of its corners are relative to object and road."""
    size = 'type="obstacle" s="50" t="-8" zOffset="3" length="9" width="9" height="10"'
    local = "".join(f'<cornerLocal u="{u}" v="{v}" z="-0.5" height="2"/>' for u, v in ((0, 0), (4, 0), (0, 2)))
    body = only(f"{size}><outline>{local}</outline>")
    assert (body.pose.z, body.height) == (2.5, 2.0)
    road = "".join(f'<cornerRoad s="{s}" t="{t}" dz="0.5" height="2"/>' for s, t in ((50, -8), (54, -8), (50, -6)))
    body = only(f"{size}><outline>{road}</outline>")
    assert (body.pose.z, body.height) == (0.5, 2.0)


@pytest.mark.parametrize("elevation", [0.0, 5.0, -5.0])
@pytest.mark.parametrize(
    ("rest", "is_solid"),
    [
        ('zOffset="0">', False),
        ('zOffset="0.8">', True),
        ('zOffset="0.8"><repeat s="50" length="0" distance="1" zOffsetStart="0" zOffsetEnd="0"/>', False),
        (f'zOffset="0"><outline>{"".join(LOCAL)}</outline>', False),
        (f'zOffset="0.8"><outline>{"".join(LOCAL)}</outline>', True),
        (f'zOffset="0.8"><outline>{"".join(ON_ROAD)}</outline>', False),
    ],
)
def test_low_object_is_solid_if_raised_above_road(rest: str, is_solid: bool, elevation: float) -> None:
    """Objects of 0.15 m are driven over unless they are above the road, whatever the height of the road is."""
    text = f'type="barrier" s="50" t="-2" length="2" width="1" height="0.15" {rest}'.replace("1.2", "0.15")
    (body,) = road_object_bodies(network(text, profiles=elevation_xml(elevation)))
    assert body.solid == is_solid


@pytest.mark.parametrize("orientation", ["+", "-", "none"])
def test_orientation_of_an_object_does_not_turn_it(orientation: str) -> None:
    """OpenDRIVE: it is the direction in which the object is valid; `hdg` is the heading. Signals differ in this."""
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="2"/>' for u, v in ((0, 0), (4, 0), (0, 2)))
    body = only(
        f'type="obstacle" s="50" t="-8" zOffset="0" orientation="{orientation}"><outline>{corners}</outline>',
    )
    assert (body.pose.x, body.pose.y, body.pose.h) == (52.0, -7.0, 0.0)


@pytest.mark.parametrize(
    ("heading", "pitch", "roll", "expected"),
    [
        (0.0, 0.5, 0.0, (4 * math.cos(0.5) + math.sin(0.5), 2.0, math.cos(0.5) - 4 * math.sin(0.5))),
        (0.0, 0.0, 0.5, (4.0, 2 * math.cos(0.5) - math.sin(0.5), math.cos(0.5) + 2 * math.sin(0.5))),
        (math.pi / 2, math.pi / 2, math.pi / 2, (1.0, 2.0, -4.0)),
    ],
)
def test_pitch_and_roll_tilt_local_outlines(
    heading: float, pitch: float, roll: float, expected: tuple[float, float, float]
) -> None:
    """The corner (4, 2, 1) is rotated about the x axis, then the y axis, then the z axis.

    By quarter turns it becomes (4, -1, 2), (2, -1, -4) and (1, 2, -4). Positive pitch lowers the front.
    """
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="{z}"/>' for u, v, z in ((4, 2, 1), (0, 0, 0), (0, 1, 0)))
    attributes = f'type="crosswalk" s="50" t="-8" pitch="{pitch}" roll="{roll}"'
    roads = network(f"{attributes}><outline>{corners}</outline>", heading=heading)
    (outline,) = crosswalks(roads)
    assert outline[0] - (50.0, -8.0, 0.0) == pytest.approx(expected)


@pytest.mark.parametrize("corners", [LOCAL, ON_ROAD])
def test_outline_is_moved_by_each_repetition(corners: list[str]) -> None:
    """The outline of 6 x 2 m begins at the object, which is repeated at s = 60, 70 and 80, t = -10, -11 and -12."""
    repeat = '<repeat s="60" length="20" distance="10" tStart="-10" tEnd="-12"/>'
    text = f'type="obstacle" s="50" t="-10" zOffset="0">{repeat}<outline>{"".join(corners)}</outline>'
    pieces = [(body.pose.x, body.pose.y, body.length, body.width) for body in road_object_bodies(network(text))]
    assert pieces == [pytest.approx(piece) for piece in ((63, -9, 6, 2), (73, -10, 6, 2), (83, -11, 6, 2))]
    crossings = crosswalks(network(text.replace("obstacle", "crosswalk")))
    centers = [outline.mean(axis=0)[:2].tolist() for outline in crossings]
    assert centers == [pytest.approx(center) for center in ((63, -9), (73, -10), (83, -11))]


def test_open_outline_is_a_wall_along_its_line() -> None:
    """OpenDRIVE 1.8, table 88: an outline that is not closed is a linear feature, not an area."""
    corners = "".join(f'<cornerRoad s="{s}" t="{t}" dz="0" height="1"/>' for s, t in ((40, -6), (60, -6), (60, 6)))
    outline = f'<outlines><outline closed="false">{corners}</outline></outlines>'
    bodies = road_object_bodies(network(f'type="barrier" s="50" t="-6" zOffset="0">{outline}'))
    walls = [(body.pose.x, body.pose.y, body.pose.h, body.length, body.height) for body in bodies]
    assert walls == [pytest.approx((50, -6, 0, 20, 1)), pytest.approx((60, 0, math.pi / 2, 12, 1))]


@pytest.mark.parametrize("is_repeated", [False, True])
def test_outline_that_repeats_its_first_corner_is_the_same(is_repeated: bool) -> None:
    """An L of two arms of 2 m has six walls."""
    points = [(0, 0), (10, 0), (10, 2), (2, 2), (2, 8), (0, 8), *[(0, 0)] * is_repeated]
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0" height="4"/>' for u, v in points)
    bodies = road_object_bodies(network(f'type="wall" s="50" t="-16" zOffset="0"><outline>{corners}</outline>'))
    assert [body.length for body in bodies] == pytest.approx([10, 2, 8, 6, 2, 8])


# Signals


def test_sign_beside_the_road_has_a_post() -> None:
    roads = network(signals=signal('s="50" t="-6" zOffset="2.2" height="0.75" width="0.75"'))
    (post,) = road_object_bodies(roads)
    assert (post.kind, post.name) == ("post", "signal 7")
    assert post.height == pytest.approx(2.95)
    (head,) = signal_heads(roads)
    assert (head.pose.z, head.width, head.height, head.carried) == (2.2, 0.75, 0.75, True)
    assert abs(head.pose.h) == pytest.approx(3.14159, abs=1e-4)
    assert post.pose.x > head.pose.x


def test_light_above_lane_has_no_post_and_paint_no_head() -> None:
    light = signal('s="50" t="-2" zOffset="5" height="0.9" width="0.3"', "1000001", "yes")
    roads = network(signals=light)
    assert [head.carried for head in signal_heads(roads)] == [False]
    assert list(road_object_bodies(roads)) == []
    line = signal('s="50" t="-2" zOffset="0" height="0.01" width="3.5"', "294")
    assert signal_heads(network(signals=line)) == []


def test_signal_with_height_of_assembly_has_its_head_on_top() -> None:
    whole = signal('s="50" t="-6" zOffset="0" height="3.2" width="0.45"', "1000001", "yes")
    (head,) = signal_heads(network(signals=whole))
    assert head.pose.z + head.height == pytest.approx(3.2)
    ground = signal('s="50" t="-6" zOffset="-0.4" height="0.8" width="0.8"')
    (head,) = signal_heads(network(signals=ground))
    assert head.pose.z == pytest.approx(2.1)


# Collisions and occlusion


def driven_into(roads: RoadNetwork, seconds: float = 4.0) -> tuple[Any, list[Any]]:
    """Return the last view and all contacts of a car that starts at x = 20 with 10 m/s along the lane and coasts."""
    spec = ActorSpec("Ego", "car", "car", (4.4, 1.8, 1.5), (1.3, 0.0, 0.75), wheelbase=2.7, max_steering=0.5)
    contacts: list[Any] = []
    with World(roads, dt=0.05) as world:
        world.add(spec, Placement(20.0, -2.0, speed=10.0), driven=True)
        for _ in range(round(seconds / 0.05)):
            world.step({}, {"Ego": Control()})
            contacts += world.view().contacts
        return world.view(), contacts


def test_pole_stops_a_car_and_is_named() -> None:
    view, contacts = driven_into(network('type="pole" name="bollard" s="40" t="-2" zOffset="0" height="1">'))
    assert view.position[0, 0] + 1.3 + 2.2 < 40.3
    assert abs(view.speed[0]) < 2.0
    assert [(contact.first, contact.second) for contact in contacts] == [("Ego", "bollard")]
    assert contacts[0].impact_speed == pytest.approx(9.7, abs=0.4)


def test_long_barrier_stops_a_car() -> None:
    repeat = '<repeat s="0" length="200" distance="0" tStart="-4.2" tEnd="0" widthStart="0.3" widthEnd="0.3"'
    rail = f'type="barrier" name="rail" s="0" t="-4.2" zOffset="0" height="0.9">{repeat} heightStart="0.9"'
    roads = network(f'{rail} heightEnd="0.9" zOffsetStart="0" zOffsetEnd="0"/>')
    _, contacts = driven_into(roads, 10.0)
    assert {contact.second for contact in contacts} == {"rail"}


def test_round_object_that_repeats_without_gaps_is_as_wide_as_its_radius() -> None:
    """A hand rail with a radius of 0.1 m, in parts of up to 5 m."""
    repeat = '<repeat s="0" length="50" distance="0" tStart="-4" tEnd="-4" radiusStart="0.1" radiusEnd="0.1"'
    rail = f'type="railing" name="rail" s="0" t="-4" zOffset="0" radius="0.1" height="1">{repeat} heightStart="1"'
    bodies = list(road_object_bodies(network(f'{rail} heightEnd="1" zOffsetStart="0" zOffsetEnd="0"/>')))
    assert sum(body.length for body in bodies) == pytest.approx(50.0)
    assert {(round(body.width, 6), body.radius) for body in bodies} == {(0.2, 0.0)}


@pytest.mark.parametrize(
    "attributes",
    [
        'type="vegetation" s="40" t="-2" zOffset="0" length="2" width="2" height="1.5">',
        'type="trafficIsland" s="40" t="-2" zOffset="0" length="2" width="2" height="0.12">',
        'type="gantry" s="40" t="-2" zOffset="0" length="0.5" width="9" height="6">',
        'type="tree" s="40" t="-6" zOffset="0" length="9" width="9" height="8">',
    ],
    ids=["bush", "curb", "gantry", "crown of a tree beside the road"],
)
def test_low_soft_and_raised_objects_do_not_stop_a_car(attributes: str) -> None:
    view, contacts = driven_into(network(attributes))
    assert view.position[0, 0] > 50.0
    assert contacts == []


def test_foliage_and_trunks_block_sight_but_not_below_crowns() -> None:
    objects = (
        'type="vegetation" s="50" t="-8" zOffset="0" length="2" width="2" height="1.5">',
        'type="tree" s="100" t="-8" zOffset="0" length="5" width="5" height="8">',
    )
    with World(network(*objects)) as world:
        x = [50.0, 50.0, 100.0, 101.0, 101.0]
        z = [1.0, 1.7, 1.0, 1.0, 4.0]
        begins, ends = ([(at, across, up) for at, up in zip(x, z, strict=True)] for across in (-2.0, -14.0))
        clear = (world.raycast(begins, ends).fraction >= 1.0).tolist()
    assert clear == [False, True, False, True, False]


def test_ray_hits_one_of_ten_thousand_posts() -> None:
    repeat = '<repeat s="0" length="200" distance="0.02" tStart="{0}" tEnd="{0}" widthStart="0.1" widthEnd="0.1"'
    post = 'type="pole" name="post" s="0" t="-9" zOffset="0" height="1">' + repeat.format(-9)
    roads = network(f'{post} heightStart="1" heightEnd="1" zOffsetStart="0" zOffsetEnd="0"/>')
    assert len(list(road_object_bodies(roads))) == 10_001
    with World(roads) as world:
        hit = world.raycast((50.0, -2.0, 0.5), [(50.0, -20.0, 0.5)])
    assert hit.position[0, 1] == pytest.approx(-8.91, abs=0.05)


@pytest.mark.parametrize("kind", ["obstacle", "building"])
def test_body_with_a_concave_outline_leaves_its_notch_free(kind: str) -> None:
    """An outline in the form of a U opens to the road: a ray enters up to the inner wall 6 m behind the opening."""
    corners = ((0, 0), (2, 0), (2, 6), (8, 6), (8, 0), (10, 0), (10, 8), (0, 8))
    outline = "".join(f'<cornerLocal u="{u}" v="{-v}" z="0" height="3"/>' for u, v in corners)
    size = 'length="10" width="8" height="3"'
    roads = network(f'type="{kind}" s="50" t="-9" zOffset="0" {size}><outline>{outline}</outline>')
    with World(roads) as world:
        hits = world.raycast([[55.0, -2.0, 1.0], [51.0, -2.0, 1.0]], [[55.0, -30.0, 1.0], [51.0, -30.0, 1.0]])
    assert hits.position[0] == pytest.approx([55.0, -15.0, 1.0], abs=0.2)
    assert hits.position[1] == pytest.approx([51.0, -9.0, 1.0], abs=0.2)
