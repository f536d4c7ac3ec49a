"""Rule about trajectories outside of roads."""

from __future__ import annotations

import pytest
from openscenario_xml import road_file_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, private_xml

from eidrive_scenario.checks.road_rules import MAX_POINTS, SPACING, RoadLintContext
from eidrive_scenario.checks.scenario_checks import check_scenario

FOLLOW = """<RoutingAction><FollowTrajectoryAction><Trajectory name="far" closed="false"><Shape><Polyline>
<Vertex><Position><WorldPosition x="0" y="0"/></Position></Vertex>
<Vertex><Position><WorldPosition x="0" y="{end}"/></Position></Vertex>
</Polyline></Shape></Trajectory><TimeReference><None/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""


@pytest.mark.parametrize(("end", "points"), [(1000.0, round(1000.0 / SPACING) + 1), (1.5e6, MAX_POINTS)])
def test_trajectory_off_road_checks_a_bounded_number_of_points(
    monkeypatch: pytest.MonkeyPatch, end: float, points: int
) -> None:
    counts = []
    outside = RoadLintContext.outside

    def count_points(self: RoadLintContext, x: list[float], y: list[float]) -> list[float]:
        counts.append(len(x))
        return outside(self, x, y)

    monkeypatch.setattr(RoadLintContext, "outside", count_points)
    report = check_scenario(
        scenario_xml(
            minor=2,
            road=road_file_xml("eidrive_library/roads/coop_1.xodr"),
            init=init_xml("Ego", private_xml(FOLLOW.format(end=end))),
            stop=end_xml(1),
        )
    )
    assert not report.errors
    assert any("trajectory 'far' leaves the road after" in str(warning) for warning in report.warnings)
    assert max(counts) == points
