"""Truth sensor: range, field of view and line of sight."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from eidrive_scenario.sensing.rig import Rig, read_all
from eidrive_scenario.sensing.settings import Mount, TruthSettings


def visible_shares(
    boxes: Any, actors: dict[str, Any], sizes: Any = None, walls: Any = (), **settings: Any
) -> dict[str, float]:
    """Return the objects in sight of the first actor, and their visible shares."""
    view = boxes.view(actors, sizes)
    first = view.names[0]
    size = (sizes or {}).get(first, (4.892, 1.837, 1.49))
    rig = Rig(boxes.spec(first, size), {"truth": TruthSettings(**settings)})
    truth = rig.read(boxes.scene(view, list(walls)), view).truth
    assert truth is not None
    return dict(zip(truth.names, truth.visibility.tolist(), strict=True))


def test_truth_excludes_car_behind_truck(boxes: Any) -> None:
    actors = {"Ego": (0, 0, 0), "Truck": (15, 0, 0), "Hidden": (30, 0, 0), "Beside": (30, 12, 0)}
    found = visible_shares(boxes, actors, {"Truck": boxes.truck})
    assert set(found) == {"Truck", "Beside"}
    assert found["Beside"] == 1.0


def test_truth_wall_hides_and_low_wall_hides_partly(boxes: Any) -> None:
    actors = {"Ego": (0, 0, 0), "Other": (30, 0, 0)}
    assert visible_shares(boxes, actors, walls=[(15, 0, 2, 0.5, 20, 4, 0)]) == {}
    # from 1.9 m, rays to the upper corners at 1.42 m pass x = 15 above 1.6 m, those to the lower at 0.07 m below 1.1 m
    assert 0.0 < visible_shares(boxes, actors, walls=[(15, 0, 0.6, 0.5, 20, 1.2, 0)])["Other"] < 1.0


def test_truth_visibility_counts_points_in_sight(boxes: Any) -> None:
    """A wall ends on the line to the right end of a car across: only points left of it are in sight."""
    actors = {"Ego": (0, 0, 0), "Across": (30, 0, math.pi / 2)}
    edge = [(15, -10, 2, 0.2, 20, 4, 0)]
    found = visible_shares(boxes, actors, walls=edge)["Across"]
    assert found == pytest.approx(0.4), "four corners of ten points; those in the middle plane fall on the edge"
    assert visible_shares(boxes, actors, walls=edge, visibility=0.4) == {"Across": pytest.approx(0.4)}
    assert visible_shares(boxes, actors, walls=edge, visibility=0.5) == {}


def test_truth_range_is_between_centers(boxes: Any) -> None:
    assert "Other" in visible_shares(boxes, {"Ego": (0, 0, 0), "Other": (49.9, 0, 0)})
    assert "Other" not in visible_shares(boxes, {"Ego": (0, 0, 0), "Other": (50.1, 0, 0)})
    assert "Other" in visible_shares(boxes, {"Ego": (0, 0, 0), "Other": (79.9, 0, 0)}, range=80.0)


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.0, -2.0])
def test_truth_field_of_view_follows_body_and_mount(boxes: Any, heading: float) -> None:
    def at(angle: float) -> tuple[float, float, float]:
        return 20 * math.cos(heading + angle), 20 * math.sin(heading + angle), 0.0

    degree = math.radians(1.0)
    actors = {"Ego": (0, 0, heading), "In": at(49 * degree), "Out": at(51 * degree), "Behind": at(math.pi)}
    assert set(visible_shares(boxes, actors, field_of_view=100.0)) == {"In"}
    back = Mount(x=0, y=0, z=1.9, yaw=180)
    assert set(visible_shares(boxes, actors, field_of_view=100.0, mount=back)) == {"Behind"}
    upside_down = Mount(x=0, y=0, z=1.9, yaw=180, pitch=180)
    assert set(visible_shares(boxes, actors, field_of_view=100.0, mount=upside_down)) == {"In"}


def test_truth_ego_body_is_transparent(boxes: Any) -> None:
    """A sensor low inside the body has a free view in all directions, without the ego body."""
    actors = {"Ego": (0, 0, 0.3), "Ahead": (9, 0, 0), "Left": (0, 5, 0), "Behind": (-9, -2, 0)}
    for mount in (Mount(x=0, y=0, z=0.6), Mount(x=-0.5, y=0, z=1.9)):
        assert visible_shares(boxes, actors, mount=mount) == {"Ahead": 1.0, "Left": 1.0, "Behind": 1.0}


def test_truth_includes_touching_body(boxes: Any) -> None:
    assert "Other" in visible_shares(boxes, {"Ego": (0, 0, 0), "Other": (3, 0.5, 0.2)})


def test_truth_from_mast_includes_car_behind_car(boxes: Any) -> None:
    """From 7 m, a car 8 m behind another is in sight; from 1 m it is not."""
    actors = {"RSU": (0, 0, 0), "Car": (20, 0, 0), "Hidden": (28, 0, 0)}
    sizes = {"RSU": (0.3, 0.3, 7.0)}
    view = boxes.view(actors, sizes)
    for height, names in ((7.0, {"Car", "Hidden"}), (1.0, {"Car"})):
        spec = boxes.spec("RSU", (0.3, 0.3, height), 0.0)
        truth = Rig(spec, {"truth": TruthSettings()}).read(boxes.scene(view), view).truth
        assert truth is not None
        assert set(truth.names) == names


def test_truth_reading_equals_view(boxes: Any) -> None:
    actors = {"Ego": (0, 0, 0), "Truck": (15, 3, 0.7)}
    view = boxes.view(actors, {"Truck": boxes.truck}, categories={"Truck": "truck"}, velocity={"Truck": (3.0, -1.0)})
    reading = Rig(boxes.spec("Ego"), {"truth": TruthSettings()}).read(boxes.scene(view), view)
    assert reading.truth is not None
    assert reading.truth.categories == ("truck",)
    np.testing.assert_array_equal(reading.truth.boxes, view.boxes[1:])
    np.testing.assert_array_equal(reading.truth.velocity, [[3.0, -1.0]])


def test_truth_velocity_is_that_of_the_center(boxes: Any) -> None:
    """A car drives along y with its rear axle on a circle of 12 m; its center is 1.35 m ahead, on a larger circle."""
    view = boxes.view({"Ego": (0, 0, 0), "Car": (15, 0, math.pi / 2)}, velocity={"Car": (0.0, 6.0)})
    view = msgspec.structs.replace(
        view, yaw_rate=np.array([0.0, 6.0 / 12.0]), offset=np.array([[0.0, 0.0, 0.75], [1.35, 0.0, 0.75]])
    )
    truth = Rig(boxes.spec("Ego"), {"truth": TruthSettings()}).read(boxes.scene(view), view).truth
    assert truth is not None
    np.testing.assert_allclose(truth.velocity, [[-1.35 / 12.0 * 6.0, 6.0]])


def test_read_all_casts_one_batch_with_individual_results(boxes: Any) -> None:
    rng = np.random.default_rng(5)
    actors = {f"Car{index}": (*rng.uniform(-40, 40, 2), rng.uniform(-3, 3)) for index in range(12)}
    view = boxes.view(actors)
    scene = boxes.scene(view, [(0, 0, 2, 1, 30, 4, 0.4)])
    rigs = [Rig(boxes.spec(name), {"truth": TruthSettings(field_of_view=200)}) for name in list(actors)[:4]]
    batch = read_all(rigs, scene, view)
    assert len(scene.casts) == 1
    for rig in rigs:
        alone, reading = rig.read(boxes.scene(view, scene.walls), view), batch[rig.station]
        assert alone.truth is not None
        assert reading.truth is not None
        assert alone.truth.names == reading.truth.names
        np.testing.assert_array_equal(alone.truth.visibility, reading.truth.visibility)
    assert any(len(reading.truth.names) < 11 for reading in batch.values() if reading.truth is not None)


def test_truth_without_objects_is_empty(boxes: Any) -> None:
    view = boxes.view({"Ego": (0, 0, 0)})
    scene = boxes.scene(view)
    truth = Rig(boxes.spec("Ego"), {"truth": TruthSettings()}).read(scene, view).truth
    assert truth is not None
    assert truth.boxes.shape == (0, 7)
    assert truth.velocity.shape == (0, 2)
    assert scene.casts == []
