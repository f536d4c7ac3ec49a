"""Roads that meet head to head: left, ahead and oncoming depend on driving directions, not on lane ids.

Road 1 runs from x = 0 to 200, road 2 from x = 400 back to 200. Lanes -1 and -2 of road 1 continue as 1 and 2 of road 2.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, road_xml, section_xml, successor_xml
from storyboard_xml import by_entity_xml, init_xml, lane_position_xml, private_xml, speed_xml, teleport_xml
from street_scene import NOTHING, OPENING
from whole_run import Run


def head_to_head(rule: str = "RHT") -> str:
    lanes = {number: lane_xml(number, 4, link=lane_links_xml(after=-number)) for number in (2, 1, -1, -2)}
    return map_xml(
        road_xml(
            length=200.0,
            link=successor_xml("2", "end"),
            lanes=section_xml(lanes[1], lanes[-1] + lanes[-2]),
            rule=rule,
        ),
        road_xml(
            "2",
            length=200.0,
            x=400.0,
            hdg=math.pi,
            link=successor_xml("1", "end"),
            lanes=section_xml(lanes[2] + lanes[1], lanes[-1]),
            rule=rule,
        ),
    )


def put(name: str, road: int, lane: int, s: float, turned: bool = False) -> str:
    orientation = '<Orientation type="relative" h="3.141592653589793"/>' if turned else ""
    return init_xml(name, teleport_xml(lane_position_xml(lane, s, road, orientation)))


def set_speed(name: str, value: float) -> str:
    return init_xml(name, speed_xml(value))


def clear(opposite: str, lanes: str = 'from="-1" to="1"') -> str:
    return by_entity_xml(f"""<RelativeClearanceCondition distanceForward="60" distanceBackward="30"
      freeSpace="false" oppositeLanes="{opposite}"><RelativeLaneRange {lanes}/><EntityRef entityRef="Other"/>
      </RelativeClearanceCondition>""")


@pytest.mark.element("RelativeClearanceCondition")
@pytest.mark.parametrize(
    ("place", "opposite", "lanes", "is_clear"),
    [
        ((2, 1, 180), "false", 'from="0" to="0"', False),  # the own lane continues as lane 1 of road 2
        ((2, 1, 180), "false", 'from="-1" to="-1"', True),
        ((2, 2, 180), "false", 'from="-1" to="-1"', False),  # to the right
        ((2, -1, 180), "false", 'from="-1" to="1"', True),  # oncoming
        ((2, -1, 180), "true", 'from="1" to="1"', False),
        ((1, 1, 190), "false", 'from="-1" to="1"', True),
        ((1, 1, 190), "true", 'from="1" to="1"', False),
        ((2, 1, 100), "false", 'from="0" to="0"', True),  # 120 m ahead
    ],
)
def test_clearance_across_head_to_head_roads_goes_by_driving_direction(
    run: Run, place: tuple[int, int, float], opposite: str, lanes: str, is_clear: bool
) -> None:
    init = put("Ego", 1, -1, 180.0) + put("Other", *place) + set_speed("Ego", 0.0) + set_speed("Other", 0.0)
    played = run(
        0.2,
        ("Ego", NOTHING, clear(opposite, lanes)),
        driven=False,
        others={"Other": (-1, 10.0, 0.0)},
        street=head_to_head(),
        init=init,
    )
    assert played.begun("event 0") == ([0.0] if is_clear else [])


@pytest.mark.parametrize(("rule", "same", "against"), [("RHT", -1, 1), ("LHT", 1, -1)])
def test_clearance_against_the_lane_counts_lanes_of_the_own_direction(
    run: Run, rule: str, same: int, against: int
) -> None:
    """The lane to which a car returns after overtaking in the oncoming lane."""
    for lane, wanted in ((same, []), (against, [0.0])):
        init = put("Ego", 1, against, 150.0, turned=True) + put("Other", 1, lane, 130.0)
        init += set_speed("Ego", 0.0) + set_speed("Other", 0.0)
        side = "-1" if rule == "RHT" else "1"
        played = run(
            0.2,
            ("Ego", NOTHING, clear("false", f'from="{side}" to="{side}"')),
            driven=False,
            others={"Other": (-1, 10.0, 0.0)},
            street=head_to_head(rule),
            init=init,
        )
        assert played.begun("event 0") == wanted


@pytest.mark.element("LaneOffsetAction")
@pytest.mark.parametrize("continuous", ["true", "false"])
def test_lane_offset_is_kept_on_a_road_with_opposite_direction(run: Run, continuous: str) -> None:
    """t of road 1 points to the left of the vehicle, t of road 2 to its right."""
    offset = f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="{continuous}">
      <LaneOffsetActionDynamics dynamicsShape="cubic" maxLateralAcc="1"/><LaneOffsetTarget>
      <AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""
    init = put("Ego", 1, -1, 100.0) + set_speed("Ego", 20.0)
    played = run(8, ("Ego", offset), driven=False, street=head_to_head(), init=init)
    y = [float(frame.view.position[0, 1]) for frame in played.frames]
    assert y[-1] == pytest.approx(-1.0, abs=1e-6)
    assert max(abs(two - one) for one, two in pairwise(y)) < 0.1


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(("count", "lane"), [(0, 1), (0, 2), (1, 2), (-1, 1)])
def test_lane_change_relative_to_entity_beyond_head_to_head_roads(run: Run, count: int, lane: int) -> None:
    """Lanes 1 and 2 of road 2 continue lanes -1 and -2 at y = -2 and -6; left of Other is nearer to the center."""
    init = put("Ego", 1, -2 if count > 0 or lane == 1 else -1, 10.0) + put("Other", 2, lane, 180.0)
    init += set_speed("Ego", 10.0) + set_speed("Other", 0.0)
    change = private_xml(f"""<LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="2"/>
      <LaneChangeTarget><RelativeTargetLane entityRef="Other" value="{count}"/></LaneChangeTarget>
      </LaneChangeAction></LateralAction>""")
    played = run(3, ("Ego", change), driven=False, others={"Other": (-1, 10.0, 0.0)}, street=head_to_head(), init=init)
    row = played.frames[-1].view.rows["Ego"]
    assert float(played.frames[-1].view.position[row, 1]) == pytest.approx(2.0 - 4.0 * lane + 4.0 * count)


@pytest.mark.element("RelativeLanePosition", "RelativeRoadPosition")
@pytest.mark.parametrize(
    ("lane", "position", "expected"),
    [
        # Ego in lane -1 towards +x at (150, -2): ahead and left are those of road 1, also on road 2
        (-1, '<RelativeLanePosition entityRef="Ego" ds="100" dLane="0" offset="0.5"/>', (250.0, -1.5)),
        (-1, '<RelativeLanePosition entityRef="Ego" ds="100" dLane="-1" offset="0.5"/>', (250.0, -5.5)),
        (-1, '<RelativeLanePosition entityRef="Ego" dsLane="100" dLane="-1" offset="0.5"/>', (250.0, -5.5)),
        (-1, '<RelativeRoadPosition entityRef="Ego" ds="100" dt="0.5"/>', (250.0, -1.5)),
        # Ego in lane 1 towards -x at (150, 2): behind it on road 2, by the axes of road 1 or by its own
        (1, '<RelativeLanePosition entityRef="Ego" ds="100" dLane="-1" offset="0.5"/>', (250.0, -1.5)),
        (1, '<RelativeLanePosition entityRef="Ego" dsLane="-100" dLane="1" offset="0.5"/>', (250.0, -2.5)),
        (1, '<RelativeRoadPosition entityRef="Ego" ds="100" dt="0.5"/>', (250.0, 2.5)),
    ],
)
def test_relative_position_on_the_next_road_keeps_the_frame_of_its_reference(
    run: Run, lane: int, position: str, expected: tuple[float, float]
) -> None:
    init = put("Ego", 1, lane, 150.0) + init_xml("Other", teleport_xml(position))
    played = run(0.1, driven=False, others={"Other": (-1, 10.0, 0.0)}, street=head_to_head(), init=init)
    view = played.frames[0].view
    assert tuple(view.position[view.rows["Other"], :2]) == pytest.approx(expected)


@pytest.mark.element("RelativeLanePosition")
@pytest.mark.parametrize(
    ("lane", "s", "offsets", "expected"),
    [
        (-1, 150.0, 'ds="120" dLane="0"', (270.0, -6.0)),
        (-1, 150.0, 'ds="120" dLane="-1"', (270.0, -10.0)),
        (-1, 150.0, 'dsLane="120" dLane="-1"', (270.0, -10.0)),
        (-3, 300.0, 'ds="-150" dLane="0"', (150.0, -6.0)),
        (-2, 300.0, 'ds="-150" dLane="-1"', (150.0, -6.0)),
        (1, 300.0, 'ds="-150" dLane="0"', (150.0, 2.0)),
    ],
)
def test_relative_position_in_the_next_lane_section_follows_lane_links(
    run: Run, lane: int, s: float, offsets: str, expected: tuple[float, float]
) -> None:
    """Lanes -1 and -2 continue as -2 and -3 from s = 200 on."""
    init = put("Ego", 1, lane, s) + init_xml(
        "Other", teleport_xml(f'<RelativeLanePosition entityRef="Ego" {offsets}/>')
    )
    played = run(0.1, ("Ego", NOTHING), driven=False, others={"Other": (-1, 10.0, 0.0)}, street=OPENING, init=init)
    view = played.frames[0].view
    assert view.position[view.row("Other"), :2].tolist() == pytest.approx(expected)
