"""Codec of compressed features: 8-bit integers, code book and expansion."""

from __future__ import annotations

import numpy as np
import pytest
from pillar_weights import random_arrays

from eidrive_scenario.perception.learned.pillars.codec import FeatureCodec


@pytest.fixture
def codec() -> FeatureCodec:
    return FeatureCodec.of(random_arrays())


def latent(count: int, spread: float = 1.0) -> np.ndarray:
    return np.random.default_rng(count).normal(0.0, spread, (8, count)).astype(np.float32)


@pytest.mark.parametrize("count", [0, 1, 7, 500])
def test_int8_round_trip_has_error_of_at_most_half_step(codec: FeatureCodec, count: int) -> None:
    z = latent(count)
    steps = codec.to_int8(z)
    assert steps.dtype == np.int8
    assert steps.shape == (8, count)
    received = codec.from_int8(steps)
    assert received.dtype == np.float32
    inside = np.abs(z) <= 127 * 0.05
    assert np.all(np.abs(received - z)[inside] <= 0.025 + 1e-6)
    np.testing.assert_array_equal(codec.to_int8(received), steps)


def test_int8_large_values_are_clipped_and_ties_are_even(codec: FeatureCodec) -> None:
    z = np.array([[-1e9, 1e9, 0.05 * 127.4, -0.05, 0.0, 0.05 * 3, 0.2, 6.35]] * 8, dtype=np.float32)
    assert codec.to_int8(z)[0].tolist() == [-127, 127, 127, -1, 0, 3, 4, 127]


@pytest.mark.parametrize("count", [0, 1, 300])
def test_codes_are_nearest_entries_of_code_book(codec: FeatureCodec, count: int) -> None:
    z = latent(count, 1.5)
    codes = codec.to_codes(z)
    assert codes.dtype == np.uint8
    distance = np.linalg.norm(z.T[:, None].astype(float) - codec.codebook[None], axis=2)
    nearest = distance.min(axis=1, initial=np.inf)
    np.testing.assert_allclose(distance[np.arange(count), codes], nearest, rtol=1e-4)


def test_codes_round_trip_returns_entries(codec: FeatureCodec) -> None:
    codes = np.arange(256, dtype=np.uint8)
    entries = codec.from_codes(codes)
    assert entries.shape == (8, 256)
    np.testing.assert_array_equal(codec.to_codes(entries), codes)


@pytest.mark.parametrize("count", [0, 1, 16384])
def test_expand_equals_matrix_product_with_relu(codec: FeatureCodec, count: int) -> None:
    arrays, z = random_arrays(), latent(count)
    expected = np.maximum(arrays["expand.weight"][:, :, 0, 0].astype(float) @ z + arrays["expand.bias"][:, None], 0.0)
    features = codec.expand(z)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, expected, atol=1e-5)
    assert np.all(features >= 0.0)
