"""Faults of perception: objects that do not exist, and a wrong pose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from pydantic import ValidationError

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.faults import FIRST_TRACK, FalseObject, with_false_objects
from eidrive_scenario.perception.localization import add_pose_error
from eidrive_scenario.sensing.readings import EgoState, Readings, TruthReading

EMPTY = Detections(4.0)
ONE = Detections(
    4.0,
    np.array([[1.0, 2.0, 0.7, 4.0, 1.8, 1.4, 0.1]]),
    np.array([0.8]),
    ("car",),
    np.array([[3.0, 0.0]]),
    np.zeros((1, 2, 2)),
    tracks=(7,),
    existence=np.array([0.9]),
)


def test_false_object_moves_at_constant_velocity_on_the_ground() -> None:
    item = FalseObject(kind="pedestrian", x=10.0, y=-2.0, z=1.0, speed=2.0, heading=90.0, since=1.0, score=0.6)
    found = with_false_objects(EMPTY, [item], with_velocity=True)
    assert found.boxes[0].tolist() == pytest.approx([10.0, 4.0, 1.9, 0.4, 0.4, 1.8, math.pi / 2])
    assert found.velocity[0].tolist() == pytest.approx([0.0, 2.0])
    assert found.covariance[0].tolist() == pytest.approx(np.eye(2) * 0.09)
    assert (found.classes, found.scores.tolist(), found.tracks) == (("pedestrian",), [0.6], ())
    assert len(found.existence) == 0


@pytest.mark.parametrize(("since", "until", "reported"), [(4.0, None, True), (4.1, None, False), (0.0, 4.0, False)])
def test_false_object_is_reported_in_its_time(since: float, until: float | None, reported: bool) -> None:
    item = FalseObject(x=0.0, y=0.0, since=since, until=until)
    assert len(with_false_objects(EMPTY, [item], with_velocity=True)) == int(reported)


def test_false_objects_are_added_to_tracks_with_constant_numbers() -> None:
    early, late = FalseObject(x=50.0, y=0.0, until=3.0), FalseObject(x=60.0, y=0.0, score=0.5, size=(9.0, 2.0, 3.0))
    found = with_false_objects(ONE, [early, late], with_velocity=False)
    assert found.tracks == (7, FIRST_TRACK + 1)
    assert found.existence.tolist() == [0.9, 0.5]
    assert found.boxes[1].tolist() == [60.0, 0.0, 1.5, 9.0, 2.0, 3.0, 0.0]
    assert np.isnan(found.velocity[1]).all()
    assert with_false_objects(ONE, [early], with_velocity=True) is ONE


def test_false_objects_keep_the_stated_deviation_of_velocities() -> None:
    measured = replace(ONE, velocity_deviation=1.5)
    assert with_false_objects(measured, [FalseObject(x=9.0, y=0.0)], with_velocity=True).velocity_deviation == 1.5


@pytest.mark.parametrize(("stated", "expected"), [([2.0], [2.0, 0.0]), ([], [])])
def test_false_objects_have_exact_velocities(stated: list[float], expected: list[float]) -> None:
    detections = replace(ONE, velocity_variance=np.array(stated))
    both = with_false_objects(detections, [FalseObject(x=9.0, y=0.0)], with_velocity=True)
    assert both.velocity_variance.tolist() == expected


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"x": 0.0}, "y"),
        ({"x": 0.0, "y": 0.0, "since": 2.0, "until": 2.0}, "until is not after since"),
        ({"x": 0.0, "y": 0.0, "kind": "ghost"}, "kind"),
        ({"x": 0.0, "y": 0.0, "score": 1.5}, "score"),
    ],
)
def test_invalid_false_objects_are_errors(settings: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        FalseObject.model_validate(settings)


def test_pose_error_moves_and_turns_all_objects_about_the_station() -> None:
    """An object 10 m ahead of a station that assumes 90° more is seen 10 m to its left."""
    ego = EgoState(0.0, np.array([5.0, 1.0, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    truth = TruthReading(
        ("Car",), ("car",), np.array([[15.0, 1.0, 0.7, 4.0, 1.8, 1.4, 0.0]]), np.array([[2.0, 0.0]]), np.ones(1)
    )
    moved = add_pose_error(Readings(0.0, ego, truth=truth), 1.0, -2.0, math.pi / 2.0)
    assert moved.truth is not None
    assert moved.ego.position.tolist() == pytest.approx([6.0, -1.0, 0.0])
    assert moved.truth.boxes[0, :2].tolist() == pytest.approx([6.0, 9.0])
    assert moved.truth.boxes[0, 6] == pytest.approx(math.pi / 2)
    assert moved.truth.velocity[0].tolist() == pytest.approx([0.0, 2.0])
