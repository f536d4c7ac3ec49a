"""Truth sensor in scalar arithmetic and with arrays: equal results."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eidrive_scenario.sensing.crossing import few_ray_starts, shares_behind
from eidrive_scenario.sensing.settings import Mount, TruthSettings
from eidrive_scenario.sensing.truth import (
    TruthSensor,
    candidates,
    few_candidates,
    few_visibilities,
    visibilities,
)
from eidrive_scenario.world.view import WorldView

coordinate = st.floats(-12.0, 12.0)
length = st.floats(0.2, 9.0)
point = st.tuples(coordinate, coordinate, coordinate)
box = st.tuples(coordinate, coordinate, coordinate, length, length, length, st.floats(-7.0, 7.0))


def starts_by_arrays(origin: Any, targets: Any, box: Any) -> Any:
    origins, ends = np.broadcast_to(origin, (1, len(targets), 3)), np.array([targets])
    return (origins + shares_behind(origins, ends, np.array([box]))[..., None] * (ends - origins))[0]


@settings(max_examples=300, deadline=None)
@given(origin=point, targets=st.lists(point, min_size=1, max_size=12), box=box)
def test_few_ray_starts_equals_arrays(origin: Any, targets: Any, box: Any) -> None:
    few = few_ray_starts(origin, targets, box)
    many = starts_by_arrays(origin, targets, box)
    np.testing.assert_allclose(np.array(few), many, rtol=0.0, atol=1e-9)


def test_few_ray_starts_along_face_equals_arrays() -> None:
    """A sensor on the roof and one on the bumper, as in usual mounts."""
    box = (2.0, 1.0, 1.0, 4.0, 2.0, 2.0, 0.0)
    for origin in [(2.0, 1.0, 2.0), (4.0, 1.0, 1.0)]:
        targets = [(9.0, 1.0, 2.0), (9.0, 1.0, 0.0), (-9.0, 1.0, 2.0), (4.0, 7.0, 1.0), (2.0, 1.0, -3.0)]
        many = starts_by_arrays(origin, targets, box)
        np.testing.assert_allclose(np.array(few_ray_starts(origin, targets, box)), many, atol=1e-12)


def stations(boxes: Any, view: WorldView) -> list[TruthSensor]:
    """Return sensors with different positions, fields of view and ranges."""
    kinds: list[dict[str, Any]] = [
        {"field_of_view": 100.0, "mount": "front"},
        {"field_of_view": 360.0, "range": 30.0},
        {"field_of_view": 200.0, "mount": Mount(x=0.0, y=0.0, z=0.7, yaw=150.0)},
    ]
    return [TruthSensor(TruthSettings(**kind), boxes.spec(name)) for kind, name in zip(kinds, view.names, strict=False)]


@pytest.mark.exhaustive
def test_few_candidates_and_visibilities_equal_arrays(boxes: Any) -> None:
    draws = np.random.default_rng(11)
    shares: list[float] = []
    for count in (3, 4, 9, 25):
        for _ in range(12):
            places = {
                f"Car{index}": (*draws.uniform(-35.0, 35.0, 2), draws.uniform(-math.pi, math.pi))
                for index in range(count)
            }
            sizes = {f"Car{index}": tuple(draws.uniform(1.0, 6.0, 3)) for index in range(3, count)}
            view = boxes.view(places, sizes)
            scene = boxes.scene(view, [(3.0, 2.0, 1.0, 9.0, 0.3, 2.0, 0.7)])
            sensors, rows, unseen = stations(boxes, view), [0, 1, 2], [2]
            few = few_candidates(sensors, rows, view, unseen)
            assert few == candidates(sensors, rows, view, unseen)
            if not any(few):
                continue
            shares_of_few = few_visibilities(sensors, rows, few, scene, view)
            assert shares_of_few == visibilities(sensors, rows, few, scene, view)
            assert len(shares_of_few) == sum(map(len, few))
            shares += shares_of_few
    assert 0.0 in shares
    assert 1.0 in shares
    assert any(0.0 < share < 1.0 for share in shares)


def test_view_boxes_with_few_actors_equal_those_with_many(boxes: Any) -> None:
    draws = np.random.default_rng(2)
    places = {f"Car{index}": tuple(draws.uniform(-30.0, 30.0, 3)) for index in range(40)}
    view = boxes.view(places)
    view.offset[:] = draws.uniform(-2.0, 2.0, (40, 3))
    few = view.without(view.names[7:])
    assert len(few.names) == 7
    np.testing.assert_allclose(few.boxes, view.boxes[:7], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(few.centers, view.centers[:7], rtol=0.0, atol=1e-12)
