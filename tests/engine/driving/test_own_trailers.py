"""Own trailers: a vehicle does not perceive or receive them as objects."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.communication.own_body import OwnBody
from eidrive_scenario.perception.localization import add_pose_error
from eidrive_scenario.perception.pipeline import outlines, rows_on_bodies, without_rows
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

TRAILER = np.array([[-9.0, 0.0, 1.5, 10.0, 2.5, 3.0, 0.0]])
"""Box of a trailer of 10 m behind the origin."""


def seen(*places: tuple[float, float], time: float = 0.0) -> Detections:
    count = len(places)
    return Detections(
        time,
        np.array([(x, y, 0.8, 4.6, 1.8, 1.5, 0.0) for x, y in places]).reshape(count, 7),
        np.ones(count),
        ("truck",) * count,
        np.zeros((count, 2)),
        np.tile(np.diag([0.01, 0.01]), (count, 1, 1)),
    )


def test_centers_on_a_body_or_within_the_margin_are_on_it() -> None:
    """Half of 10 m and 2.5 m, and 0.9 m more."""
    found = seen((-9.0, 0.0), (-3.2, 0.0), (-3.0, 0.0), (-9.0, 2.1), (-9.0, 2.2), (-14.8, -2.1))
    assert rows_on_bodies(found, outlines(TRAILER)) == [0, 1, 3, 5]
    turned = TRAILER.copy()
    turned[0, 6] = math.pi / 2.0
    assert rows_on_bodies(found, outlines(turned)) == [0, 3, 4]
    assert rows_on_bodies(found, outlines(TRAILER[:0])) == []
    assert rows_on_bodies(seen(), outlines(TRAILER)) == []
    assert without_rows(found, []) is found
    assert without_rows(found, [0, 1, 3, 5]).boxes[:, 0].tolist() == [-3.0, -9.0]


@pytest.mark.parametrize("kind", ["pedestrian", "bicycle"])
def test_vulnerable_road_users_beside_a_body_are_others(kind: str) -> None:
    """A pedestrian walks 0.1 m beside a side at 1.25 m; for the body of one, the margin applies."""
    detections = replace(seen((-9.0, 1.2), (-9.0, 1.35), (-3.2, 0.0)), classes=(kind,) * 3)
    (trailer,) = outlines(TRAILER)
    assert rows_on_bodies(detections, [trailer]) == [0]
    assert rows_on_bodies(detections, [trailer._replace(is_vulnerable=True)]) == [0, 1, 2]


def test_received_trailer_is_removed_at_its_place_of_the_measurement(car: ActorSpec) -> None:
    own = OwnBody(car, duration=2.0, dt=0.1)
    for tick in range(11):
        x = 10.0 * tick * 0.1
        ego = EgoState(tick * 0.1, np.array([x, 0.0, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        own.record(ego, TRAILER + np.array([x, 0, 0, 0, 0, 0, 0]))
    late = seen((-9.0, 0.0), (1.0, 0.0), time=0.0)
    assert own.without(late).boxes[:, 0].tolist() == []
    assert own.without(seen((-9.0, 0.0), (1.0, 0.0), time=1.0)).boxes[:, 0].tolist() == [-9.0]
    kept = own.without_perceived(seen((1.0, 0.0), (30.0, 0.0), time=1.0), "RSU", None, None, None)
    assert kept.boxes[:, 0].tolist() == [30.0]


def test_pose_error_moves_the_trailer_with_its_vehicle() -> None:
    """A quarter turn about the vehicle at the origin, and 2 m ahead: from 9 m behind to 9 m to the right."""
    ego = EgoState(0.0, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    moved = add_pose_error(Readings(0.0, ego, attached=TRAILER), 2.0, 0.0, math.pi / 2.0).attached
    assert moved[0, [0, 1, 6]].tolist() == pytest.approx([2.0, -9.0, math.pi / 2.0])
    assert TRAILER[0, 0] == -9.0


def test_all_trailers_of_a_road_train_are_attached() -> None:
    with World() as world:
        for place, name in enumerate(("Truck", "First", "Second", "Other")):
            spec = ActorSpec(name, "truck", "truck", (5.0, 2.5, 3.0), (0.0, 0.0, 1.5), wheelbase=3.0)
            world.add(spec, Placement(-10.0 * place, 0.0))
        pairs = ("Truck", "First"), ("First", "Second"), ("Second", "Gone")
        world.set_trailers([frozenset(pair) for pair in pairs])
        assert world.attached("Truck") == ("First", "Second")
        assert world.attached("Second") == ("Truck", "First")
        assert world.attached("Other") == ()
        world.set_trailers([])
        assert world.attached("Truck") == ()
