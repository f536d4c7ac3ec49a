"""Placement of features on the grid of a receiver, against closed forms and plain statements."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion.feature_warp import ENOUGH, Grid, attend, scatter, warp

N, C = 24, 8
HERE = Grid(10.0, -5.0, 0.4, 0.5, (N, N))
NOTHING = np.empty((0, 7))


def features(share: float = 1.0, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    random = generator(seed, "features")
    present = random.random((N, N)) < share
    latent = random.normal(size=(N, N, C)).astype(np.float32)
    latent[~present] = 0.0
    return latent, present


def moved(grid: Grid, ahead: float, left: float, turn: float = 0.0) -> Grid:
    """Return the grid at a position ahead and to the left of it, in cells, with another heading."""
    cos, sin = math.cos(grid.yaw), math.sin(grid.yaw)
    x, y = ahead * grid.cell, left * grid.cell
    return Grid(grid.x + cos * x - sin * y, grid.y + sin * x + cos * y, grid.yaw + turn, grid.cell, grid.shape)


def test_grid_coordinates_and_points_are_inverse() -> None:
    center = (N - 1) / 2.0
    np.testing.assert_allclose(HERE.to_world(np.array([center, center])), [10.0, -5.0])
    np.testing.assert_allclose(
        HERE.to_world(np.array([center + 2.0, center])), [10.0 + math.cos(0.4), -5.0 + math.sin(0.4)]
    )
    coordinates = generator(0, "places").uniform(-5, 30, (10, 2))
    np.testing.assert_allclose(HERE.to_coordinates(HERE.to_world(coordinates)), coordinates)
    cells, inside = HERE.cells(HERE.to_world(np.array([[0.4, 2.6], [-0.6, 3.0], [23.4, 23.4], [23.6, 0.0]])))
    assert inside.tolist() == [True, False, True, False]
    assert cells[inside].tolist() == [[0, 3], [23, 23]]


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_equal_grids_keep_features(share: float) -> None:
    latent, present = features(share)
    warped, is_present = warp(latent, present, HERE, HERE, NOTHING, 0.0)
    np.testing.assert_array_equal(is_present, present)
    np.testing.assert_allclose(warped, latent, atol=1e-6)


def test_grid_at_whole_cells_shifts_features() -> None:
    latent, present = features(0.7)
    warped, is_present = warp(latent, present, HERE, moved(HERE, 3.0, -2.0), NOTHING, 0.0)
    np.testing.assert_array_equal(is_present[:-3, 2:], present[3:, :-2])
    assert not is_present[-3:].any()
    assert not is_present[:, :2].any()
    np.testing.assert_allclose(warped[:-3, 2:], latent[3:, :-2], atol=1e-5)


def test_grid_turned_by_right_angle_turns_features() -> None:
    """The x axis of the receiver is the y axis of the sender, its y axis points to -x."""
    latent, present = features(0.7)
    warped, is_present = warp(latent, present, HERE, moved(HERE, 0.0, 0.0, math.pi / 2.0), NOTHING, 0.0)
    expected = latent[::-1].swapaxes(0, 1)
    np.testing.assert_array_equal(is_present, present[::-1].T)
    np.testing.assert_allclose(warped, expected, atol=1e-5)


def test_grid_at_half_cells_has_means() -> None:
    latent, present = features()
    warped, is_present = warp(latent, present, HERE, moved(HERE, 0.5, 0.5), NOTHING, 0.0)
    mean = (latent[:-1, :-1] + latent[1:, :-1] + latent[:-1, 1:] + latent[1:, 1:]) / 4.0
    assert is_present[:-1, :-1].all()
    np.testing.assert_allclose(warped[:-1, :-1], mean, atol=1e-6)


def test_grid_with_larger_cells_samples_centers() -> None:
    coarse = Grid(HERE.x, HERE.y, HERE.yaw, 3.0 * HERE.cell, (N // 3, N // 3))
    latent, present = features(0.5)
    warped, is_present = warp(latent, present, HERE, coarse, NOTHING, 0.0)
    np.testing.assert_array_equal(is_present, present[1::3, 1::3])
    np.testing.assert_allclose(warped, latent[1::3, 1::3], atol=1e-6)


def test_absent_cells_have_no_weight() -> None:
    """At 0.4 of a cell beyond cell (5, 5) along x: alone it is the nearest, its neighbor has a weight of 0.4."""
    latent, present = features()
    for kept, expected in (((5, 5), True), ((6, 5), False)):
        alone = np.zeros_like(present)
        alone[kept] = True
        warped, is_present = warp(latent, alone, HERE, moved(HERE, 0.4, 0.0), NOTHING, 0.0)
        assert is_present[5, 5] == expected
        np.testing.assert_allclose(warped[5, 5], latent[kept] if expected else 0.0, atol=1e-6)


def plain_warp(
    latent: np.ndarray, present: np.ndarray, sender: Grid, receiver: Grid, moving: np.ndarray, age: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the result of `warp` by its statement, cell by cell in the world."""
    warped, is_present = np.zeros((*receiver.shape, C)), np.zeros(receiver.shape, bool)

    def inside(point: np.ndarray, box: np.ndarray) -> bool:
        x, y = point - box[:2]
        cos, sin = math.cos(box[2]), math.sin(box[2])
        return bool(abs(cos * x + sin * y) <= box[3] / 2 and abs(cos * y - sin * x) <= box[4] / 2)

    for i, j in np.ndindex(*receiver.shape):
        point = receiver.to_world(np.array([i, j]))
        sources = [point - box[5:] * age for box in moving if inside(point - box[5:] * age, box)]
        if not sources and any(inside(point, box) for box in moving):
            continue
        source = sender.to_coordinates(sources[0] if sources else point)
        low = np.floor(source).astype(int)
        total, value, nearest = 0.0, np.zeros(C), False
        for corner in low + np.array([[0, 0], [0, 1], [1, 0], [1, 1]]):
            if (corner >= 0).all() and (corner < sender.shape).all() and present[tuple(corner)]:
                weight = np.prod(1.0 - abs(source - corner))
                total, value = total + weight, value + weight * latent[tuple(corner)]
                nearest |= bool((np.floor(source + 0.5) == corner).all())
        if nearest or total >= ENOUGH:
            warped[i, j], is_present[i, j] = value / total, True
    return warped, is_present


@pytest.mark.parametrize("seed", range(6))
def test_warp_equals_plain_statement(seed: int) -> None:
    random = generator(seed, "poses")
    latent, present = features(random.uniform(0.2, 1.0), seed)
    ahead, left, turn = random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(-3, 3)
    receiver = moved(HERE, ahead, left, turn)
    centers = HERE.to_world(random.uniform(0, N, (4, 2)))
    sizes = random.uniform(1.0, 4.0, (4, 2))
    moving = np.column_stack([centers, random.uniform(-3, 3, 4), sizes, random.uniform(-10, 10, (4, 2))])
    warped, is_present = warp(latent, present, HERE, receiver, moving, 0.2)
    expected, expected_present = plain_warp(latent, present, HERE, receiver, moving, 0.2)
    np.testing.assert_array_equal(is_present, expected_present)
    np.testing.assert_allclose(warped, expected, atol=1e-5)


def test_features_of_moving_object_move_with_it() -> None:
    """A box of 2 x 1 cells about cell (8, 12) drives 5 cells ahead: its cells are there, and not behind it."""
    latent, present = features()
    center = HERE.to_world(np.array([8.0, 12.0]))
    ahead = np.array([math.cos(HERE.yaw), math.sin(HERE.yaw)])
    velocity = 5.0 * HERE.cell / 0.1 * ahead
    moving = np.array([[*center, HERE.yaw, 2.2 * HERE.cell, 1.0 * HERE.cell, *velocity]])
    warped, is_present = warp(latent, present, HERE, HERE, moving, 0.1)
    np.testing.assert_allclose(warped[12:15, 12], latent[7:10, 12], atol=1e-4)
    assert not is_present[7:10, 12].any()
    changed = np.zeros((N, N), bool)
    changed[7:10, 12] = changed[12:15, 12] = True
    np.testing.assert_allclose(warped[~changed], latent[~changed], atol=1e-6)
    backward, _ = warp(latent, present, HERE, HERE, moving, -0.1)
    np.testing.assert_allclose(backward[2:5, 12], latent[7:10, 12], atol=1e-4)


def test_far_grid_has_no_features() -> None:
    latent, present = features()
    for far in (Grid(1e9, -1e9, 1.0, 0.8, (N, N)), Grid(40.0, 0.0, 0.0, 1e-3, (N, N))):
        assert not warp(latent, present, HERE, far, NOTHING, 0.0)[1].any()


def test_scatter_equals_assignment_by_mask() -> None:
    random = generator(0, "place")
    present, values = random.random((6, 7)) < 0.4, random.random((3, 42)).astype(np.float32)
    grid, expected = np.zeros((2, 3, 6, 7), np.float32)
    scatter(np.ascontiguousarray(values[:, : present.sum()]), present, grid)
    expected[:, present] = values[:, : present.sum()]
    np.testing.assert_array_equal(grid, expected)


def test_attention_equals_plain_statement() -> None:
    random = generator(0, "attention")
    own = random.uniform(0, 1, (96, 5, 7)).astype(np.float32)
    received = random.uniform(0, 1, (3, 96, 5, 7)).astype(np.float32)
    present = random.random((3, 5, 7)) < 0.5
    stations = np.concatenate([own[None], received]).astype(float)
    scores = np.einsum("cij,scij->sij", own, stations) / math.sqrt(96.0)
    scores[1:][~present] = -np.inf
    weights = np.exp(scores) / np.exp(scores).sum(axis=0)
    np.testing.assert_allclose(attend(own, received, present), (weights[:, None] * stations).sum(axis=0), rtol=1e-5)


def test_attention_of_large_features_is_finite() -> None:
    own = np.full((96, 2, 2), 300.0, np.float32)
    received = np.stack([own * 2.0, own * 0.0])
    present = np.array([np.full((2, 2), True), np.full((2, 2), False)])
    np.testing.assert_allclose(attend(own, received, present), 600.0)
