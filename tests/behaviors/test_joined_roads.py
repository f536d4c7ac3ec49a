"""Roads that meet head to head: left, ahead and oncoming depend on driving directions, not on lane ids.

Road 1 runs from x = 0 to 200, road 2 from x = 400 back to 200. Lanes -1 and -2 of road 1 continue as 1 and 2 of road 2.
"""

from __future__ import annotations

import pytest
from whole_run import Run

LANE = """<lane id="{0}" type="driving" level="false"><link><successor id="{1}"/></link>
  <width sOffset="0" a="4" b="0" c="0" d="0"/></lane>"""
ROAD = """<road name="" length="200" id="{id}" junction="-1"{rule}><link>
  <successor elementType="road" elementId="{other}" contactPoint="end"/></link>
  <planView><geometry s="0" x="{x}" y="0" hdg="{hdg}" length="200"><line/></geometry></planView>
  <lanes><laneSection s="0"><left>{left}</left><center><lane id="0" type="none" level="false"/></center>
  <right>{right}</right></laneSection></lanes></road>"""


def head_to_head(rule: str = "") -> str:
    lanes = {number: LANE.format(number, -number) for number in (2, 1, -1, -2)}
    first = ROAD.format(id=1, other=2, x=0, hdg=0, rule=rule, left=lanes[1], right=lanes[-1] + lanes[-2])
    second = ROAD.format(
        id=2, other=1, x=400, hdg=3.141592653589793, rule=rule, left=lanes[2] + lanes[1], right=lanes[-1]
    )
    return f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{first}{second}</OpenDRIVE>'


LEFT_HAND = ' rule="LHT"'


def put(name: str, road: int, lane: int, s: float, turned: bool = False) -> str:
    orientation = '<Orientation type="relative" h="3.141592653589793"/>' if turned else ""
    return f"""<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
      <LanePosition roadId="{road}" laneId="{lane}" s="{s}">{orientation}</LanePosition></Position></TeleportAction>
      </PrivateAction></Private>"""


def set_speed(name: str, value: float) -> str:
    return f"""<Private entityRef="{name}"><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction></Private>"""


def clear(opposite: str, lanes: str = 'from="-1" to="1"') -> str:
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
      </TriggeringEntities><EntityCondition><RelativeClearanceCondition distanceForward="60" distanceBackward="30"
      freeSpace="false" oppositeLanes="{opposite}"><RelativeLaneRange {lanes}/><EntityRef entityRef="Other"/>
      </RelativeClearanceCondition></EntityCondition></ByEntityCondition>"""


NOTHING = '<PrivateAction><VisibilityAction graphics="true" sensors="true" traffic="true"/></PrivateAction>'


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


@pytest.mark.parametrize(("rule", "same", "against"), [("", -1, 1), (LEFT_HAND, 1, -1)])
def test_clearance_against_the_lane_counts_lanes_of_the_own_direction(
    run: Run, rule: str, same: int, against: int
) -> None:
    """The lane to which a car returns after overtaking in the oncoming lane."""
    for lane, wanted in ((same, []), (against, [0.0])):
        init = put("Ego", 1, against, 150.0, turned=True) + put("Other", 1, lane, 130.0)
        init += set_speed("Ego", 0.0) + set_speed("Other", 0.0)
        side = "-1" if rule == "" else "1"
        played = run(
            0.2,
            ("Ego", NOTHING, clear("false", f'from="{side}" to="{side}"')),
            driven=False,
            others={"Other": (-1, 10.0, 0.0)},
            street=head_to_head(rule),
            init=init,
        )
        assert played.begun("event 0") == wanted
