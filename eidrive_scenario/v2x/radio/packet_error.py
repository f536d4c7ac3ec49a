"""Packet error curves by signal-to-interference-and-noise ratio, with their sources."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.v2x.analytic import cv2x_mode4, ieee80211p


@dataclass(frozen=True)
class ErrorCurve:
    """Packet error rate at ascending ratios [dB]; 1 below the first and `floor` above the last.

    size  packet size of the curve [bytes]; None: any size
    """

    ratios: tuple[float, ...]
    errors: tuple[float, ...]
    size: int | None
    source: str
    floor: float = 0.0

    def shifted(self, by: float) -> ErrorCurve:
        """Return the curve with the same error rates at ratios that are higher [dB]."""
        return replace(self, ratios=tuple(ratio + by for ratio in self.ratios))

    @cached_property
    def _points(self) -> tuple[Array, Array]:
        """Ratios and error rates as arrays, which `numpy.interp` would otherwise make of them in each call."""
        return np.array(self.ratios), np.array(self.errors)

    def ratio_of(self, error: float) -> float:
        """Return the ratio with this packet error rate at the size of the curve [dB]."""
        return float(np.interp(-error, -np.array(self.errors), self.ratios))

    def at(self, ratio_db: Array, size: float | Array) -> Array:
        """Return the packet error rate of packets of `size` [bytes], broadcast.

        Sizes other than that of the curve assume independent byte errors: 1 - (1 - PER)^(size / size of the curve).
        """
        errors = np.interp(ratio_db, *self._points, left=1.0, right=self.floor)
        if self.size is None:
            return errors
        scaled: Array = 1.0 - (1.0 - errors) ** (np.asarray(size) / self.size)
        return scaled


CURVE_RATE_MBPS = 6.0
"""Data rate of all curves of 802.11p [Mbit/s]."""

_WILAB = "WiLabV2Xsim, IEEE 802.11p at 6 Mbit/s (MCS 2), 350 bytes, channel model "
_GOUBET_RATIOS, _GOUBET_ERRORS = ieee80211p.FRAME_ERRORS

_FREE_DISTANCE = 10
_BIT_ERROR_WEIGHTS = (36, 211, 1404, 11633, 77433, 502690, 3322763, 21292910, 134365911)
"""Weights of the convolutional code (133, 171) of rate 1/2 at Hamming distances 10 to 26 (P. Frenger et al., 1999)."""
_NIST_SIZE = 100
_NIST_RATIOS = tuple(round(3.0 + 0.05 * step, 2) for step in range(181))


def nist_qpsk_errors(ratio_db: float, size: int) -> float:
    """Return the packet error rate of QPSK with rate 1/2 (6 Mbit/s in 10 MHz) in white noise, for `size` in bytes.

    NIST model of ns-3 (G. Pei, T. Henderson: Validation of OFDM error rate model in ns-3, 2010): Chernoff and union
    bound of the bit errors of a Viterbi decoder with hard decisions; bit errors are independent.
    """
    ratio = 10.0 ** (ratio_db / 10.0)
    raw = 0.5 * math.erfc(math.sqrt(ratio / 2.0))
    bound = math.sqrt(4.0 * raw * (1.0 - raw))
    weighted = sum(weight * bound ** (_FREE_DISTANCE + 2 * index) for index, weight in enumerate(_BIT_ERROR_WEIGHTS))
    return 1.0 - (1.0 - min(1.0, weighted / 2.0)) ** (8 * size)


_CODED_STEP_DB = 0.25
"""Distance of the points of curves of coded modulation [dB]."""


@cache
def _quadrature() -> tuple[Array, Array]:
    """Return nodes and weights of Gauss and Hermite."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(64)
    return nodes, weights / weights.sum()


@lru_cache(maxsize=4096)  # curves for other sizes of packets have the same ratios
def _capacity(ratio: float, order: int) -> tuple[float, float]:
    """Return mean and variance of the information density of square QAM in white noise, in bits per symbol.

    Both dimensions are amplitude modulations with equally likely levels; the noise is integrated by Gauss and Hermite.
    """
    levels = np.arange(1 - 2 ** (order // 2), 2 ** (order // 2), 2).astype(float)
    levels *= math.sqrt(0.5 / np.mean(levels**2))
    deviation = math.sqrt(0.5 / ratio)
    nodes, weights = _quadrature()
    noise = deviation * nodes
    apart = levels[:, None, None] - levels[None, :, None] + noise
    exponents = (noise**2 - apart**2) / (2.0 * deviation**2)
    density = order / 2.0 - np.log2(np.exp(exponents).sum(axis=1))
    share = weights / len(levels)
    mean = float((density * share).sum())
    return 2.0 * mean, 2.0 * float((density**2 * share).sum() - mean**2)


def coded_errors(ratio_db: float, bits: int, symbols: int, order: int) -> float:
    """Return the packet error rate of `bits` in `symbols` of QAM with `order` bits each, in white noise.

    Normal approximation of the best code at this length (Y. Polyanskiy, H. V. Poor, S. Verdú: Channel coding rate in
    the finite blocklength regime, IEEE Transactions on Information Theory 56(5), 2010).
    """
    mean, variance = _capacity(10.0 ** (ratio_db / 10.0), order)
    excess = symbols * mean + 0.5 * math.log2(symbols) - bits
    return 0.5 * math.erfc(excess / math.sqrt(2.0 * symbols * max(variance, 1e-12)))


def coded_curve(bits: int, symbols: int, order: int, size: int | None) -> ErrorCurve:
    """Return the packet error curve of `coded_errors`, for packets of `size` bytes; None: any size."""
    points = [
        (ratio, error)
        for ratio in np.arange(-20.0, 40.0, _CODED_STEP_DB).tolist()
        if 1e-6 < (error := coded_errors(ratio, bits, symbols, order)) < 1.0 - 1e-6
    ]
    ratios, errors = zip(*points, strict=True)
    return ErrorCurve(ratios, errors, size, "normal approximation, Polyanskiy et al. 2010")


_PSCCH_ERRORS = (
    1.0, 0.9883, 0.9784, 0.9721, 0.9631, 0.9517, 0.9325, 0.9133, 0.8783, 0.849, 0.8048, 0.7565, 0.6958, 0.6325, 0.5703,
    0.5049, 0.4273, 0.3733, 0.2989, 0.2437, 0.1932, 0.1467, 0.1126, 0.0785, 0.0592, 0.0423, 0.0265, 0.0186, 0.011,
    0.0072, 0.0031, 0.0026, 0.0011, 0.0008, 0.0003, 0.0002, 0.0001, 0.0,
)  # fmt: skip

CURVES = {
    "80211p_highway_los": ErrorCurve(
        tuple(map(float, range(-2, 9))),
        (0.9916, 0.9388, 0.7662, 0.5076, 0.264, 0.1108, 0.0404, 0.0132, 0.0028, 0.001, 0.0002),
        350,
        _WILAB + "highway LOS",
    ),
    "80211p_highway_nlos": ErrorCurve(
        tuple(map(float, range(1, 11))),
        (0.996, 0.9714, 0.8928, 0.6886, 0.4328, 0.2014, 0.0712, 0.02, 0.0024, 0.001),
        350,
        _WILAB + "highway NLOS",
    ),
    "80211p_crossing_nlos": ErrorCurve(
        tuple(map(float, range(1, 11))),
        (0.9896, 0.933, 0.766, 0.5012, 0.2412, 0.087, 0.0236, 0.0068, 0.0008, 0.0002),
        350,
        _WILAB + "crossing NLOS",
    ),
    "80211p_goubet": ErrorCurve(
        tuple(ratio - 10.0 * float(np.log10(10e6 / 6e6)) for ratio in _GOUBET_RATIOS),
        _GOUBET_ERRORS,
        None,
        "O. Goubet et al., IEEE TVT 64(9), 2015, fig. 14, at 6 Mbit/s in 10 MHz, as in Sepulcre et al. 2021",
        floor=0.001,
    ),
    "80211p_nist": ErrorCurve(
        _NIST_RATIOS,
        tuple(nist_qpsk_errors(ratio, _NIST_SIZE) for ratio in _NIST_RATIOS),
        _NIST_SIZE,
        "G. Pei, T. Henderson: Validation of OFDM error rate model in ns-3, 2010, at 6 Mbit/s in 10 MHz",
    ),
    "cv2x_r0.7": ErrorCurve(
        *cv2x_mode4.CODINGS[4][1:], cv2x_mode4.MESSAGE, "3GPP R1-160284, QPSK r = 0.7, 280 km/h, 190 bytes", floor=1e-4
    ),
    "pscch": ErrorCurve(
        tuple(round(-6.2 + 0.2 * step, 1) for step in range(len(_PSCCH_ERRORS))),
        _PSCCH_ERRORS,
        None,
        "NIST, LTE D2D model of ns-3 (public domain): PSCCH, SCI in additive white Gaussian noise, one antenna",
    ),
    "cv2x_r0.5": ErrorCurve(
        *cv2x_mode4.CODINGS[2][1:], cv2x_mode4.MESSAGE, "3GPP R1-160284, QPSK r = 0.5, 280 km/h, 190 bytes", floor=1e-4
    ),
}
