"""Tests of meshes: closed skins with outward faces inside the bounding box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from eidrive_scenario.rendering.materials import MATERIALS, PAINTS, paint
from eidrive_scenario.rendering.meshes import BUILDERS, actor_mesh, solids
from eidrive_scenario.rendering.meshes.road_objects import building, road_object_mesh
from eidrive_scenario.rendering.model import model
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle
from eidrive_scenario.world.specs import SHAPES

SIZES = {
    "car": (4.892, 1.837, 1.490), "firetruck": (8.468, 2.891, 3.827), "ambulance": (6.366, 2.351, 2.431),
    "bus": (12.135, 2.55, 3.12), "van": (5.93, 2.02, 2.62), "truck": (8.3, 2.5, 3.55), "motorbike": (2.2, 0.8, 1.6),
    "bicycle": (1.8, 0.65, 1.75), "pedestrian": (0.375, 0.375, 1.86), "rsu": (0.5, 0.5, 5.0), "box": (1.0, 2.0, 0.5),
}  # fmt: skip
AXLES = {
    "car": (2.85, 0.34), "firetruck": (4.7, 0.52), "ambulance": (4.0, 0.38), "bus": (5.9, 0.478),
    "van": (3.66, 0.35), "truck": (4.8, 0.5), "motorbike": (1.45, 0.31), "bicycle": (1.05, 0.34),
}  # fmt: skip


def volume(triangles: np.ndarray) -> float:
    """Return the volume of a closed skin, positive for outward faces (divergence theorem)."""
    return float(np.einsum("ki,ki->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6)


def spec_of(shape: str) -> ActorSpec:
    length, width, height = SIZES[shape]
    wheelbase, radius = AXLES.get(shape, (0.0, 0.3))
    return ActorSpec(
        "A",
        shape,
        "car",
        (length, width, height),
        (wheelbase / 2, 0.0, height / 2),
        wheelbase=wheelbase,
        wheel_radius=radius,
    )


@pytest.mark.parametrize(
    ("solid", "expected"),
    [
        (lambda: solids.box((1, 2, 3), (2, 3, 4)), 24.0),
        (lambda: solids.tapered_box((0, 0, 0), (2, 2, 3), (1, 1)), 7.0),
        (lambda: solids.cylinder((0, 0, 0), (0, 3, 0), 1.0, sides=400), 3 * np.pi),
        (lambda: solids.cylinder((0, 0, 0), (0, 0, -3), 1.0, sides=400), 3 * np.pi),
        (lambda: solids.ball((5, 5, 5), (1, 2, 3), 80, 80), 8 * np.pi),
        (lambda: solids.bevelled_box((1, 1, 1), (4, 2, 2), 0.001), 16.0),
        (lambda: solids.mirrored(solids.box((1, 2, 3), (2, 3, 4))), 24.0),
    ],
)
def test_solids_are_closed_with_outward_faces(solid: Callable[[], np.ndarray], expected: float) -> None:
    assert volume(solid()) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("kind", ["pole", "lamp", "guide post"])
def test_road_object_without_radius_is_drawn_as_its_box(kind: str) -> None:
    """As the part of a row of poles without gaps, which is a box of 5 m, 0.3 m and 4 m."""
    (skin,) = road_object_mesh(kind, "", 5.0, 0.3, 4.0, 0.0).values()
    assert volume(skin) == pytest.approx(6.0, rel=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_each_shape_fills_its_box(shape: str) -> None:
    mesh = actor_mesh(spec_of(shape))
    points = np.concatenate([triangles.reshape(-1, 3) for triangles in mesh.values()])
    length, width, height = SIZES[shape]
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.array([length / 2, width / 2, 0.0])
    # Lamps, mirrors, hands and similar parts may protrude by a few centimeters.
    assert (low >= -half - np.array([0.12, 0.12, 0.02])).all(), low
    assert (high <= half + np.array([0.12, 0.12, height + 0.03])).all(), high
    assert high[2] - low[2] >= 0.95 * height
    assert high[0] - low[0] >= 0.85 * length
    assert sum(len(triangles) for triangles in mesh.values()) < 5000
    assert all(volume(triangles) >= -1e-6 for material, triangles in mesh.items() if material == "paint")


@pytest.mark.parametrize("shape", AXLES)
def test_axles_far_from_the_box_are_drawn_in_it(shape: str) -> None:
    length, _, height = SIZES[shape]
    axles = (ExtraAxle(300.0, 1.0, 0.3),)
    mesh = actor_mesh(replace(spec_of(shape), offset=(100.0, 0.0, height / 2), extra_axles=axles))
    assert all(np.abs(triangles[..., 0]).max() < 0.7 * length for triangles in mesh.values())


@pytest.mark.parametrize("shape", SHAPES)
def test_body_smaller_than_its_details_fills_its_box(shape: str) -> None:
    """At 1 : 500, as a truck of 1.7 cm; handlebars and shoes are wider than the narrowest bodies, by a factor of 3."""
    spec = spec_of(shape)
    size, offset = (np.array(spec.size) / 500.0).tolist(), (np.array(spec.offset) / 500.0).tolist()
    for radius in (spec.wheel_radius / 500.0, spec.wheel_radius):
        tiny = replace(spec, size=size, offset=offset, wheelbase=spec.wheelbase / 500.0, wheel_radius=radius)
        points = np.concatenate([triangles.reshape(-1, 3) for triangles in actor_mesh(tiny).values()])
        assert (np.ptp(points, axis=0) < 3.0 * np.array(size)).all()


def test_model_of_body_of_a_micrometer_fills_its_box() -> None:
    mesh = actor_mesh(ActorSpec("A", "box", "misc", (1e-6, 1e-6, 1e-6), (0.0, 0.0, 5e-7)))
    np.testing.assert_allclose(model(mesh, {"paint": (1.0, 1.0, 1.0)}).half, 5e-7, rtol=1e-4)


def test_all_shapes_have_meshes_and_all_materials_colors() -> None:
    assert set(BUILDERS) == set(SHAPES)
    for shape in SHAPES:
        assert set(actor_mesh(spec_of(shape))) <= {*MATERIALS, "paint"}
    assert set(building((20.0, 10.0, 9.0))) <= {*MATERIALS, "wall"}


def test_meshes_are_cached_by_size() -> None:
    assert actor_mesh(spec_of("car")) is actor_mesh(spec_of("car"))


def test_paint_depends_on_the_name() -> None:
    assert paint("Ego", "car") == paint("Ego", "car")
    assert len({paint(f"Car {index}", "car") for index in range(40)}) == len(PAINTS)
    assert paint("Ego", "firetruck") == MATERIALS["red"]
