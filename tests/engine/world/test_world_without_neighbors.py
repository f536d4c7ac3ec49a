"""Comparison of driven cars that move without pybullet with cars that move in pybullet."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from opendrive_xml import elevation_xml, lanes_xml, map_xml, road_xml, superelevation_xml
from sample_car import CarFactory

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.physics.bodies import DrivenBody, ScriptedBody
from eidrive_scenario.world.physics.body_group import BodyGroup
from eidrive_scenario.world.physics.engine import Physics

HILL = map_xml(
    road_xml(
        length=400.0,
        hdg=0.4,
        profiles=elevation_xml(1, 0.04, 0.0005) + superelevation_xml(0.03),
        lanes=lanes_xml(0, 1, 30),
    )
)


def wild_ride(tick: int) -> Control:
    """Return throttle, curves to both sides, a full brake, and reverse."""
    if tick < 60:
        return Control(throttle=0.8, steering=0.05 * math.sin(0.3 * tick))
    if tick < 120:
        return Control(throttle=0.2, steering=0.4)
    if tick < 180:
        return Control(brake=0.9, steering=-0.3)
    return Control(throttle=0.5, steering=0.5, reverse=True)


def watch_all(
    physics: Physics, bodies: BodyGroup, driven: Mapping[str, DrivenBody]
) -> tuple[list[ScriptedBody], dict[str, DrivenBody]]:
    return [], dict(driven)


def ride(spec: ActorSpec, roads: RoadNetwork | None) -> np.ndarray:
    """Return all values of the view of the car (ticks, 14)."""
    rows = []
    with World(roads, dt=0.05) as world:
        world.add(spec, Placement(12.0, -4.0, yaw=0.6, speed=3.0), driven=True)
        for tick in range(240):
            world.step({}, {spec.name: wild_ride(tick)})
            view = world.view()
            angles = (view.yaw[0], view.pitch[0], view.roll[0], view.yaw_rate[0], view.speed[0])
            rows.append([*view.position[0], *view.velocity[0], *view.acceleration[0], *angles])
    return np.array(rows)


@pytest.mark.parametrize("hilly", [False, True])
def test_motion_without_pybullet_equals_pybullet(car: CarFactory, hilly: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    roads = RoadNetwork.parse(HILL) if hilly else None
    without = ride(car(), roads)
    monkeypatch.setattr(Physics, "_within_reach", watch_all)
    inside = ride(car(), roads)
    assert np.ptp(without[:, 9]) > math.pi
    # pybullet rotates a body on a slope by the gyroscopic moment of its substitute inertia, some 1e-6 rad per step.
    assert without == pytest.approx(inside, abs=1e-3 if hilly else 1e-9)


def test_cars_use_pybullet_only_near_others(car: CarFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    watched: list[bool] = []
    find = Physics._within_reach

    def noted(
        physics: Physics, bodies: BodyGroup, driven: Mapping[str, DrivenBody]
    ) -> tuple[list[ScriptedBody], dict[str, DrivenBody]]:
        found = find(physics, bodies, driven)
        watched.append(bool(found[1]))
        return found

    monkeypatch.setattr(Physics, "_within_reach", noted)
    gaps = []
    with World(dt=0.05) as world:
        world.add(car("Ego"), Placement(0.0, 0.0, speed=10.0), driven=True)
        world.add(car("Parked"), Placement(60.0, 2.6))
        for _ in range(200):
            gaps.append(world.distance("Ego", "Parked"))
            world.step({}, {"Ego": Control(throttle=0.1)})
        assert world.view().contacts == ()
    # The gap is 0.8 m while one car passes the other, at half a meter per tick.
    assert min(gaps) == pytest.approx(0.8)
    assert all(seen for gap, seen in zip(gaps, watched, strict=True) if gap <= 0.81)
    assert not any(seen for gap, seen in zip(gaps, watched, strict=True) if gap > 1.2)


def test_parked_car_stays_until_throttle(car: CarFactory) -> None:
    with World(dt=0.05) as world:
        world.add(car(), Placement(3.0, 1.0, yaw=0.7), driven=True)
        for _ in range(20):
            world.step({}, {"Ego": Control(brake=1.0, steering=0.2)})
        parked = world.view()
        assert (parked.speed[0], parked.yaw_rate[0]) == (0.0, 0.0)
        assert parked.position[0].tolist() == [3.0, 1.0, 0.0]
        hit = world.raycast([[3.0, 1.0, 10.0]], [[3.0, 1.0, 0.0]])
        assert hit.rows.tolist() == [0]
        world.step({}, {"Ego": Control(throttle=1.0, steering=0.2)})
        assert world.view().speed[0] == pytest.approx(0.05 * 4.0, rel=0.05)
