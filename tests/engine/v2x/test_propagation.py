"""Path loss, airtime and packet error rates compared with published values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.v2x.counter_random import uniform, uniforms
from eidrive_scenario.v2x.propagation import (
    LinkGeometry,
    LogDistance,
    Tr37885,
    WinnerB1,
    blockage_moments,
    building_nlos,
    free_space,
    highway_los,
    probability_of_los,
    urban_los,
    winner_b1,
)
from eidrive_scenario.v2x.radio.packet_error import CURVES
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LOS, NLOS, NLOSV
from eidrive_scenario.v2x.standards import fragments, ieee80211p_airtime

D = np.array([10.0, 100.0, 1000.0])


def between(state: int, distance: float, top: float = 3.0, lower: float = 1.6, upper: float = 1.6) -> LinkGeometry:
    vehicles = np.array([1 if state == NLOSV else 0])
    heights = [np.array([value]) for value in (lower, upper, top)]
    return LinkGeometry(np.array([distance]), np.array([state]), heights[0], heights[1], heights[2], vehicles)


def test_path_loss_of_tr_37_885_equals_ns_3() -> None:
    """Values of the three-gpp-v2v tests of ns-3 at 5 GHz."""
    assert urban_los(D, 5.0) == pytest.approx([68.1913, 84.8913, 101.5913], abs=1e-4)
    assert highway_los(D, 5.0) == pytest.approx([66.3794, 86.3794, 106.3794], abs=1e-4)
    assert building_nlos(D, 5.0) == pytest.approx([80.0605, 110.0605, 140.0605], abs=1e-4)


def test_path_loss_of_tr_37_885_at_100_m() -> None:
    at = np.array([100.0])
    assert urban_los(at, 5.9)[0] == pytest.approx(86.20, abs=0.005)
    assert highway_los(at, 5.9)[0] == pytest.approx(87.82, abs=0.005)
    assert building_nlos(at, 5.9)[0] == pytest.approx(111.42, abs=0.005)


@pytest.mark.parametrize(
    ("environment_height", "break_point", "loss"), [(1.0, 19.7, 112.1), (0.5, 78.5, 101.7), (0.0, 177, 95.6)]
)
def test_winner_b1_depends_on_environment_height(environment_height: float, break_point: float, loss: float) -> None:
    height = 1.5 - environment_height
    frequency = 5.9
    assert 4 * height**2 * frequency * 1e9 / 3e8 == pytest.approx(break_point, rel=0.01)
    assert winner_b1(np.array([200.0]), frequency, height, height)[0] == pytest.approx(loss, abs=0.1)


def test_winner_b1_is_at_least_free_space_and_constant_below_3_m() -> None:
    distance = np.linspace(0.0, 1000.0, 400)
    loss = winner_b1(distance, 5.9, 1.5, 1.5)
    free = 20 * np.log10(np.maximum(distance, 3.0)) + 46.4 + 20 * math.log10(5.9 / 5)
    assert np.all(loss >= free)
    assert len(set(loss[distance < 3.0])) == 1


def test_blockage_moments_by_height_of_the_blocking_vehicle() -> None:
    """No loss below both antennas, 9 dB above both, 5 dB between them; more beyond 541 m (15 lg d > 41)."""
    near, far = np.array([50.0]), np.array([1000.0])
    one = np.ones(1)
    assert [m[0] for m in blockage_moments(near, 2.0 * one, 3.0 * one, 1.6 * one)] == [0.0, 0.0]
    assert [m[0] for m in blockage_moments(near, 1.6 * one, 1.6 * one, 3.0 * one)] == [9.0, 4.5]
    assert [m[0] for m in blockage_moments(near, 1.6 * one, 5.0 * one, 3.0 * one)] == [5.0, 4.0]
    assert blockage_moments(far, 1.6 * one, 1.6 * one, 3.0 * one)[0][0] == pytest.approx(9.0 + 45.0 - 41.0)


@pytest.mark.parametrize("environment", ["urban", "highway"])
def test_path_loss_by_line_of_sight_state_differs_by_the_model_loss(environment: str) -> None:
    model = Tr37885.model_validate({"environment": environment, "blockage": "mean"})
    half = np.array([0.5])
    clear, behind, hidden = (float(model.loss(between(s, 60.0), 5.9, half)[0]) for s in (LOS, NLOSV, NLOS))
    assert behind - clear == pytest.approx(9.0)
    assert hidden == pytest.approx(float(building_nlos(np.array([60.0]), 5.9)[0]))


def test_blockage_loss_has_mean_and_spread_of_tr_37_885() -> None:
    """Moments by the midpoint rule; the normal distribution is truncated at 0 dB, which affects 2.3 %."""
    draws = (np.arange(20000) + 0.5) / 20000
    one = np.ones(20000)
    states = np.full(20000, NLOSV)
    many = LinkGeometry(60.0 * one, states, 1.6 * one, 1.6 * one, 3.0 * one, np.ones(20000, dtype=np.int64))
    for blockage, tolerance in (("lognormal", 0.01), ("normal", 0.06)):
        model = Tr37885.model_validate({"blockage": blockage})
        extra = model.loss(many, 5.9, draws) - urban_los(many.distance, 5.9)
        assert extra.mean() == pytest.approx(9.0, abs=tolerance * 9.0)
        assert extra.std() == pytest.approx(4.5, abs=tolerance * 4.5)
        assert extra.min() >= 0.0


@pytest.mark.parametrize(
    ("lower", "upper", "environment_height", "effective"),
    [
        (1.5, 6.0, 1.0, (0.5, 5.0)),
        (1.5, 6.0, 0.5, (1.0, 5.5)),
        (2.0, 3.5, 0.0, (2.0, 3.5)),
        (0.3, 1.0, 1.0, (0.5, 0.5)),
    ],
)
def test_winner_b1_subtracts_environment_height_of_each_antenna(
    lower: float, upper: float, environment_height: float, effective: tuple[float, float]
) -> None:
    """TR 36.885, A.1.4: 40 lg d + 7.56 - 17.3 lg h1' - 17.3 lg h2' + 2.7 lg f beyond 4 h1' h2' f / c, before that
    22.7 lg d + 27 + 20 lg f, and at least the loss of free space. Antennas below 1.5 m count as 1.5 m.
    """
    model = WinnerB1(kind="winner_b1", environment_height=environment_height)
    h1, h2 = effective
    break_point = 4.0 * h1 * h2 * 5.9e9 / 3e8
    for distance in (15.0, 0.9 * break_point, 1.1 * break_point, 1000.0):
        near = 22.7 * math.log10(distance) + 27.0 + 20.0 * math.log10(5.9)
        far = 40.0 * math.log10(distance) + 7.56 - 17.3 * math.log10(h1 * h2) + 2.7 * math.log10(5.9)
        sight = between(LOS, distance, lower=lower, upper=upper)
        free = 20.0 * math.log10(distance) + 46.4 + 20.0 * math.log10(5.9 / 5.0)
        expected = max(near if distance < break_point else far, free)
        assert model.loss(sight, 5.9, np.array([0.5]))[0] == pytest.approx(expected, abs=1e-9)


def test_winner_b1_adds_a_loss_per_vehicle() -> None:
    model = WinnerB1(kind="winner_b1")
    half = np.array([0.5])
    clear, behind = (float(model.loss(between(s, 60.0), 5.9, half)[0]) for s in (LOS, NLOSV))
    assert behind - clear == pytest.approx(6.9)
    assert float(model.loss(between(NLOS, 60.0), 5.9, half)[0]) > behind


def test_probability_of_los_equals_tr_37_885() -> None:
    distance = np.array([50.0, 100.0, 200.0, 300.0])
    assert probability_of_los(distance, "urban") == pytest.approx([0.5938, 0.3358, 0.1074, 0.0343], abs=5e-5)
    assert probability_of_los(distance, "highway") == pytest.approx([0.9246, 0.8403, 0.7034, 0.6084], abs=5e-5)


@pytest.mark.parametrize(
    ("size", "milliseconds"), [(190, 0.304), (300, 0.448), (500, 0.712), (800, 1.112), (1100, 1.512), (1400, 1.912)]
)
def test_ieee80211p_airtime_at_6_mbit_s(size: int, milliseconds: float) -> None:
    assert ieee80211p_airtime(size, 6.0, 1400) == pytest.approx(milliseconds * 1e-3, abs=1e-9)


def test_airtime_of_a_message_above_the_mtu_is_that_of_several_frames() -> None:
    assert fragments(3000, 1400) == (1400, 1400, 200)
    assert fragments(1400, 1400) == (1400,)
    assert fragments(0, 1400) == (0,)
    assert ieee80211p_airtime(2800, 6.0, 1400) == pytest.approx(2 * 1.912e-3)


def test_delivery_ratio_over_distance_without_interference() -> None:
    """Mean over 4 dB of shadowing: TR 37.885 urban NLOS, 23 dBm, two antennas of 3 dBi, -95 dBm noise, LOS curve."""
    curve = CURVES["80211p_highway_los"]
    shadow = np.linspace(-20.0, 20.0, 4001)
    weight = np.exp(-0.5 * (shadow / 4.0) ** 2)
    weight /= weight.sum()
    ratios = {100: 0.996, 150: 0.924, 200: 0.714, 300: 0.252, 400: 0.061}
    for distance, expected in ratios.items():
        snr = 23.0 + 6.0 - building_nlos(np.array([float(distance)]), 5.9) + 95.0 + shadow
        assert float(np.sum(weight * (1.0 - curve.at(snr, 350)))) == pytest.approx(expected, abs=0.001)


def test_packet_error_curves_decrease_and_larger_packets_have_more_errors() -> None:
    ratios = np.linspace(-10.0, 40.0, 501)
    for name, curve in CURVES.items():
        errors = curve.at(ratios, 350)
        assert np.all(np.diff(errors) <= 1e-12), name
        assert errors[0] == 1.0
        assert errors[-1] <= 0.002
        if curve.size is not None:
            assert np.all(curve.at(ratios, 2 * curve.size) >= curve.at(ratios, curve.size))
            assert curve.at(np.array([3.0]), 2 * curve.size)[0] == pytest.approx(
                1.0 - (1.0 - curve.at(np.array([3.0]), curve.size)[0]) ** 2
            )


def test_uniform_and_uniforms_agree_to_the_bit() -> None:
    keys = np.array([0, 1, 2**63, 2**64 - 1, 0x9E3779B97F4A7C15], dtype=np.uint64)
    for count in (-1, 0, 1, 12345678):
        assert [uniform(key, count) for key in keys.tolist()] == uniforms(keys, count).tolist()


def test_log_distance_equals_free_space_at_its_reference_distance() -> None:
    """20 lg(4 pi 5.9e9 / 3e8) = 47.86 dB at 1 m, 25 dB per decade; 46.6777 dB of ns-3 applies to 5.15 GHz."""
    assert free_space(1.0, 5.9) == pytest.approx(47.86, abs=0.005)
    assert free_space(1.0, 5.15) == pytest.approx(46.6777, abs=0.01)
    model = LogDistance(kind="log_distance", exponent=2.5)
    assert model.loss(between(LOS, 100.0), 5.9, np.array([0.5]))[0] == pytest.approx(97.86, abs=0.005)
    assert model.loss(between(NLOSV, 100.0), 5.9, np.array([0.5]))[0] == pytest.approx(97.86 + 6.9, abs=0.005)
    assert model.loss(between(NLOS, 100.0), 5.9, np.array([0.5]))[0] == pytest.approx(111.42, abs=0.005)
    given = LogDistance(kind="log_distance", exponent=3.0, reference_distance=10.0, reference_loss_db=60.0)
    assert [given.loss(between(LOS, d), 5.9, np.array([0.5]))[0] for d in (1.0, 10.0, 100.0)] == [60, 60, 90]


def test_nist_packet_errors_of_qpsk_equal_ns_3() -> None:
    """ns-3 3.44 delivers 0.9825, 0.5325 and 0.231 of 20,000 packets of 336 bytes at 7.08, 6.05 and 5.80 dB."""
    curve = CURVES["80211p_nist"]
    ratios = np.array([23.0 - 47.86 - 25.0 * math.log10(meters) + 96.975 for meters in (400, 440, 450)])
    assert 1.0 - curve.at(ratios, 336) == pytest.approx([0.9825, 0.53245, 0.23095], abs=0.01)


@pytest.mark.parametrize(("rate", "decibels"), [(3.0, -3.0), (12.0, 5.0), (27.0, 14.0)])
def test_range_shrinks_with_the_sensitivity_at_the_data_rate(rate: float, decibels: float) -> None:
    """In free space, 20 dB per decade of distance: the range of IEEE 802.11-2012, table 18-14, relative to 6 Mbit/s."""
    distance = np.geomspace(10.0, 1e5, 4000)
    reaches = []
    for data_rate in (6.0, rate):
        profile = RadioProfile(data_rate_mbps=data_rate)
        ratio = profile.radiated - free_space(distance, profile.frequency_ghz) - profile.noise
        reaches.append(distance[np.flatnonzero(profile.curves[0].at(ratio, 350) < 0.5)[-1]])
    assert reaches[0] / reaches[1] == pytest.approx(10.0 ** (decibels / 20.0), rel=0.01)
