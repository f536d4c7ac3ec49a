"""Tables of packet errors over distance, and the received levels on a road that analytic models compute them from.

Both analytic models average a packet error curve over shadowed signal and shadowed interference. Each average is one
correlation and one matrix product.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.v2x.propagation import winner_b1


@dataclass(frozen=True)
class ErrorTable:
    """Error probabilities by distance. Causes are exclusive and ordered: a packet is lost for the first that applies.

    distance  (D,) distance between the antennas, ascending [m]
    given     by cause: conditional probability (D,), given that no earlier cause applies
    channel_busy_ratio  in [0, 1]
    """

    distance: Array
    given: Mapping[str, Array]
    channel_busy_ratio: float

    @cached_property
    def errors(self) -> Mapping[str, Array]:
        """Error probability (D,) by cause."""
        left = np.ones_like(self.distance)
        errors = {}
        for cause, probability in self.given.items():
            errors[cause] = left * probability
            left = left - errors[cause]
        return errors

    @cached_property
    def delivery_ratio(self) -> Array:
        """Packet delivery ratio (D,)."""
        ratio: Array = 1.0 - np.sum(list(self.errors.values()), axis=0)
        return ratio

    def cause(self, distance: float, draw: float) -> str | None:
        """Return the cause of loss of a packet over this distance [m]; None if it is delivered.

        `draw` is a uniform number in (0, 1). The last entry of the table applies beyond its end.
        """
        reached = 0.0
        for cause, probability in self.errors.items():
            reached += float(np.interp(distance, self.distance, probability))
            if draw < reached:
                return cause
        return None


STEP = 0.1
"""Grid step of the power levels [dB]."""
LEVELS: Array = np.round(np.arange(-2000, 2001) * STEP, 1)
"""Power levels (L,) [dBm]."""
RATIOS: Array = np.round(np.arange(-4000, 4001) * STEP, 1)
"""Ratios (2 L - 1,) of two power levels [dB]."""
SHADOWING = 3.0
"""Standard deviation of the shadowing in both models [dB]."""
REACH, FARTHEST_INTERFERER = 1500, 1000
"""Maximum distances at which vehicles contribute to the load and interfere [m]."""


def interference(power: Array, noise: float) -> Array:
    """Return the distribution (I, L) of noise plus one shadowed interferer, for mean powers (I,) [dBm]."""
    total = 10.0 ** (LEVELS[noise < LEVELS] / 10.0)
    alone = total - 10.0 ** (noise / 10.0)
    exponent = -0.5 * ((10.0 * np.log10(alone) - power[:, None]) / SHADOWING) ** 2
    density = np.zeros((len(power), len(LEVELS)))
    density[:, noise < LEVELS] = total / alone * np.exp(exponent)
    return _normalize(density)


@dataclass(frozen=True)
class Road:
    """Straight road with equal vehicles.

    density         vehicles per meter
    power, sensing  transmission power and sensing threshold [dBm]
    frequency       carrier frequency [GHz]
    height          height of the antennas above the environment [m]
    """

    density: float
    power: float
    sensing: float
    frequency: float
    height: float

    def received(self, distance: Array) -> Array:
        """Return the mean received power over distances [dBm]."""
        return self.power - winner_b1(distance, self.frequency, self.height, self.height)

    def sensed(self, distance: Array) -> Array:
        """Return the share of packets that vehicles sense over distances."""
        from scipy.special import erf

        share: Array = 0.5 * (1.0 + erf((self.received(distance) - self.sensing) / (SHADOWING * math.sqrt(2.0))))
        return share

    @cached_property
    def sensed_around(self) -> Array:
        """Share of packets that vehicles sense at each meter up to REACH before and behind the sender."""
        return self.sensed(np.arange(-REACH, REACH + 1.0))

    def errors(self, distance: Array, curve: Array) -> Array:
        """Return the error rate (D, L) of sensed packets over distances (D,) at each level of noise and interference.

        curve  (2 L - 1,) packet error rate by RATIOS
        """
        density = np.exp(-0.5 * ((LEVELS - self.received(distance)[:, None]) / SHADOWING) ** 2)
        density[:, self.sensing > LEVELS] = 0.0
        middle = len(LEVELS) - 1
        full = _convolve(_normalize(density), curve[None, ::-1], axes=1)
        errors: Array = np.clip(full[:, middle : middle + len(LEVELS)], 0.0, 1.0)
        return errors

    def interferers(self, distance: Array, errors: Array, noise: float, alone: Array) -> tuple[Array, Array, Array]:
        """Return the positions of interferers relative to the receiver (I,), their distances from the sender (D, I)
        [m], and the probability (D, I) that each destroys a packet that is received without it.

        errors  as by `errors`;  noise  [dBm];  alone  (D,) packet error rate without an interferer
        """
        count = round(FARTHEST_INTERFERER * self.density)
        positions = np.arange(-count, count + 1) / self.density
        positions = positions[positions != 0.0]
        with_interferer = errors @ interference(self.received(positions), noise).T
        certain = alone[:, None] >= 1.0
        added = (with_interferer - alone[:, None]) / np.where(certain, 1.0, 1.0 - alone[:, None])
        return positions, np.abs(positions + distance[:, None]), np.where(certain, 0.0, added)


def autocorrelation(values: Array) -> Array:
    """Return the autocorrelation of a sequence at lags 0, 1, 2, …"""
    correlated: Array = _convolve(values, values[::-1], axes=0)[len(values) - 1 :]
    return correlated


def _normalize(density: Array) -> Array:
    shares: Array = density / density.sum(axis=1, keepdims=True)
    return shares


def _convolve(first: Array, second: Array, axes: int) -> Array:
    from scipy.signal import fftconvolve  # here, as its import takes a fifth of the time of `eidrive check`

    convolved: Array = fftconvolve(first, second, axes=axes)
    return convolved
