"""Ways of thousands of kilometers that a file requests of a driven vehicle: an error with its line."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import agent_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    private_xml,
    speed_xml,
    teleport_xml,
)

from eidrive_scenario.errors import InputError
from eidrive_scenario.simulation import run_file

TRAJECTORY = """<RoutingAction>
<FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape>{}</Shape></Trajectory>
</TrajectoryRef><TimeReference><None/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>
</RoutingAction>"""
START = '<Position><WorldPosition x="0" y="-1.75"/></Position>'
FAR = '<Position><WorldPosition x="1e9" y="-1.75"/></Position>'
POLYLINE = TRAJECTORY.format(f'<Polyline><Vertex time="0">{START}</Vertex><Vertex time="1">{FAR}</Vertex></Polyline>')
CLOTHOID = TRAJECTORY.format(f'<Clothoid curvature="0.001" curvaturePrime="0" length="1e9">{START}</Clothoid>')
ACQUIRE = f"<RoutingAction>\n<AcquirePositionAction>{FAR}</AcquirePositionAction></RoutingAction>"
WAYPOINT = '<Waypoint routeStrategy="shortest"><Position>{}</Position></Waypoint>'
WAYPOINTS = "".join(WAYPOINT.format(lane_position_xml(-1, s)) for s in (10, 210_010))
ROUTE = f"""<RoutingAction>
<AssignRouteAction><Route name="r" closed="false">{WAYPOINTS}</Route></AssignRouteAction></RoutingAction>"""
MEGABYTES = 2.0**20


def write(folder: Path, action: str, *, driven: bool = True) -> Path:
    """Write a scenario with an action of Ego on a straight road, which is 220 km long if there is a route on it."""
    length = 220_000.0 if action is ROUTE else 1000.0
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=1), length=length)))
    path = folder / "a.xosc"
    event = event_xml("e", private_xml("\n" + action))
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr"),
            entities=object_xml("Ego", controller=agent_xml(planner="route") if driven else ""),
            init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 10)), speed_xml(10)),
            story=acts_xml(act_xml(group_xml(maneuver_xml(event)), "<StartTrigger/>")),
            stop=end_xml(0.2),
        )
    )
    return path


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("action", "kilometers"),
    [(POLYLINE, "1,000,000"), (CLOTHOID, "1,000,000"), (ACQUIRE, "1,000,000"), (ROUTE, "210")],
    ids=["polyline", "clothoid", "position", "route"],
)
def test_way_of_a_driven_vehicle_that_is_too_long(tmp_path: Path, action: str, kilometers: str) -> None:
    path = write(tmp_path, action)
    name = "AssignRouteAction" if action is ROUTE else action.split("<")[2].split(">")[0]
    line = next(number for number, text in enumerate(path.read_text().splitlines(), 1) if f"<{name}" in text)
    tracemalloc.start()
    with pytest.raises(InputError) as caught:
        run_file(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < (200.0 if action is ROUTE else 60.0) * MEGABYTES
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert f"the way to the destination has a length of {kilometers} km" in str(caught.value)
    assert "at most 200 km" in str(caught.value)


@pytest.mark.parametrize("action", [POLYLINE, CLOTHOID, ROUTE], ids=["polyline", "clothoid", "route"])
def test_scripted_vehicle_may_have_a_long_way(tmp_path: Path, action: str) -> None:
    assert run_file(write(tmp_path, action, driven=False)).end_reason == "stop trigger"
