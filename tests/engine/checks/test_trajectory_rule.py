"""Rule about trajectories outside of roads."""

from __future__ import annotations

import pytest

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.checks.road_rules.paths import MAX_POINTS, SPACING
from eidrive_scenario.checks.scenario_checks import check_scenario

FILE = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="t" author="test"/>
<CatalogLocations><VehicleCatalog><Directory path="eidrive_library/catalogs"/></VehicleCatalog></CatalogLocations>
<RoadNetwork><LogicFile filepath="eidrive_library/roads/coop_1.xodr"/></RoadNetwork>
<Entities><ScenarioObject name="Ego"><CatalogReference catalogName="vehicles" entryName="lincoln_mkz"/></ScenarioObject>
</Entities><Storyboard><Init><Actions><Private entityRef="Ego"><PrivateAction><RoutingAction><FollowTrajectoryAction>
<Trajectory name="far" closed="false"><Shape><Polyline>
<Vertex><Position><WorldPosition x="0" y="0"/></Position></Vertex>
<Vertex><Position><WorldPosition x="0" y="{end}"/></Position></Vertex>
</Polyline></Shape></Trajectory><TimeReference><None/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction></Private>
</Actions></Init><StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
</Storyboard></OpenSCENARIO>"""


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
    report = check_scenario(FILE.format(end=end).encode())
    assert not report.errors
    assert any("trajectory 'far' leaves the road after" in str(warning) for warning in report.warnings)
    assert max(counts) == points
