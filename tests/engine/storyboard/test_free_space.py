"""Free space along a road or trajectory that turns around, with numbers by hand.

The road consists of 50 m along x, a bend of 180° to the left and 50 m back. Boxes reach 4 m ahead of their reference
point and 1 m behind it.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.roads import Pose, RoadNetwork
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, TrajectoryProgress
from eidrive_scenario.storyboard.positions.distances import distance

BEND = 20.0 * math.pi
HAIRPIN = map_xml(
    road_xml(
        length=100.0 + BEND,
        geometry=f"""<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>
        <geometry s="50" x="50" y="0" hdg="0" length="{BEND!r}"><arc curvature="0.05"/></geometry>
        <geometry s="{50.0 + BEND!r}" x="50" y="40" hdg="{math.pi!r}" length="50"><line/></geometry>""",
    )
)


@pytest.fixture
def on_hairpin(context: Any) -> Any:
    """A at s = 20 in lane -1, B at s = 80 + 20π in lane -1, 60 m + 20π ahead."""
    roads = RoadNetwork.parse(HAIRPIN)
    made = RuntimeContext(context.scenario, roads, dt=0.1, seed=0)
    for name, lane, s in (("A", -1, 20.0), ("B", -1, 80.0 + BEND)):
        here = roads.location("1", lane, s)
        made.add_actor(name, ResolvedPosition(roads.pose(here), here))
    return made


@pytest.mark.parametrize("frame", ["lane", "road"])
@pytest.mark.parametrize(("lane", "their_rear"), [(-1, 1.0), (1, 4.0)])
def test_free_space_around_a_bend_is_between_facing_ends(
    on_hairpin: Any, frame: str, lane: int, their_rear: float
) -> None:
    """The end of B that is nearer to A along the road is its rear, or its front in the oncoming lane.

    Along the lane of A the half circle has the radius 21.75 m instead of 20 m; that of B is its own lane.
    """
    here = on_hairpin.roads.location("1", lane, 80.0 + BEND)
    on_hairpin.add_actor("B", ResolvedPosition(on_hairpin.roads.pose(here), here))
    for actors, own_lane in ((("A", "B"), -1), (("B", "A"), lane)):
        bend = BEND * (1.0 - own_lane * 1.75 / 20.0) if frame == "lane" else BEND
        gap = distance(on_hairpin, *actors, frame=frame, kind="longitudinal", freespace=True)
        assert (gap if actors[0] == "A" else abs(gap)) == pytest.approx(60.0 + bend - 4.0 - their_rear)


def test_free_space_along_a_trajectory_that_turns_around(on_hairpin: Any) -> None:
    """Along x at y = -1.75, 43.5 m to the left, and back: 50 m + 43.5 m + 50 m from A to B."""
    corners = ((0.0, -1.75, 0.0), (70.0, -1.75, 0.0), (70.0, 41.75, 0.5 * math.pi), (0.0, 41.75, math.pi))
    poses = tuple(Pose(x, y, 0.0, heading, 0.0, 0.0) for x, y, heading in corners)
    curve = TrajectoryCurve((0.0, 70.0, 113.5, 183.5), poses, None)
    on_hairpin.actors["A"].set_progress(TrajectoryProgress(curve, 20.0))
    found = distance(on_hairpin, "A", "B", frame="trajectory", kind="longitudinal", freespace=True)
    assert found == pytest.approx(143.5 - 4.0 - 1.0)
