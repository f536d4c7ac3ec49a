"""Propagation: path loss by line-of-sight state with the loss by blocking bodies, and fast fading."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniforms
from eidrive_scenario.v2x.radio_environment import LOS, NLOSV
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT

Values = Array | float

SPEED_OF_LIGHT = 3e8
"""Speed of light, rounded as in the published models [m/s]."""

NEAREST = 3.0
"""Minimum distance of the WINNER+ formulas [m]; the loss is constant below it (TR 36.885, A.1.4)."""


def highway_los(distance: Values, frequency_ghz: float) -> Array:
    """Return the LOS path loss on highways [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 32.4 + 20.0 * np.log10(distance) + 20.0 * np.log10(frequency_ghz)
    return loss


def urban_los(distance: Values, frequency_ghz: float) -> Array:
    """Return the LOS path loss in urban streets [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 38.77 + 16.7 * np.log10(distance) + 18.2 * np.log10(frequency_ghz)
    return loss


def building_nlos(distance: Values, frequency_ghz: float) -> Array:
    """Return the NLOS path loss behind buildings [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 36.85 + 30.0 * np.log10(distance) + 18.9 * np.log10(frequency_ghz)
    return loss


def blockage_moments(distance: Values, lower: Values, upper: Values, blocker: Values) -> tuple[Array, Array]:
    """Return mean and standard deviation of the additional loss by blocking vehicles [dB] (3GPP TR 37.885, 6.2.1).

    lower, upper  heights of the lower and the higher antenna; blocker  top of the highest blocking vehicle [m]
    """
    far = np.maximum(0.0, 15.0 * np.log10(distance) - 41.0)
    mean = np.where(upper < blocker, 9.0 + far, 5.0 + far)
    spread = np.where(upper < blocker, 4.5, 4.0)
    over = lower > blocker
    return np.where(over, 0.0, mean), np.where(over, 0.0, spread)


def winner_b1(distance: Values, frequency_ghz: float, first: Values, second: Values) -> Array:
    """Return the LOS path loss of WINNER+ B1 [dB] over a distance [m], as adopted in 3GPP TR 36.885, A.1.4.

    `first` and `second` are the effective antenna heights: height above ground minus environment height [m]. Published
    implementations differ in the environment height (1.0, 0.5 or 0 m). It shifts the break point and changes the loss
    at 200 m by 16 dB.
    """
    distance = np.maximum(np.abs(distance), NEAREST)
    break_point = 4.0 * first * second * frequency_ghz * 1e9 / SPEED_OF_LIGHT
    decades = np.log10(distance)
    near = 22.7 * decades + 27.0 + 20.0 * np.log10(frequency_ghz)
    heights = 17.3 * np.log10(first) + 17.3 * np.log10(second)
    far = 40.0 * decades + 7.56 - heights + 2.7 * np.log10(frequency_ghz)
    free_space = 20.0 * decades + 46.4 + 20.0 * np.log10(frequency_ghz / 5.0)
    loss: Array = np.maximum(np.where(distance < break_point, near, far), free_space)
    return loss


def free_space(distance: Values, frequency_ghz: float) -> Array:
    """Return the free-space path loss (Friis) [dB] over a distance [m]: 20 lg(4 pi d f / c)."""
    loss: Array = 20.0 * np.log10(4.0 * np.pi * distance * frequency_ghz * 1e9 / SPEED_OF_LIGHT)
    return loss


def log_distance(distance: Values, exponent: float, reference: float, reference_loss: Values) -> Array:
    """Return the log-distance path loss [dB] over a distance [m].

    The loss is `reference_loss` [dB] up to `reference` [m] and rises by 10 `exponent` dB per decade beyond.
    """
    loss: Array = reference_loss + 10.0 * exponent * np.log10(np.maximum(distance, reference) / reference)
    return loss


def probability_of_los(distance: Values, environment: str) -> Array:
    """Return the probability of LOS between two cars of random traffic (3GPP TR 37.885, table 6.2-1).

    environment  `highway` or `urban`
    """
    if environment == "urban":
        return np.minimum(1.0, 1.05 * np.exp(-0.0114 * distance))
    near = np.minimum(1.0, 2.1013e-6 * distance**2 - 0.002 * distance + 1.0193)
    return np.where(distance <= 475.0, near, np.maximum(0.0, 0.54 - 0.001 * (distance - 475.0)))


@dataclass
class LinkGeometry:
    """Geometry of M links; the code of state LOS is 0.

    distance      (M,) distance between the antennas [m]
    states        (M,) LOS, NLOSV or NLOS
    lower, upper  (M,) heights of the lower and the higher antenna above the ground [m]
    tops          (M,) top of the highest blocking vehicle [m]
    vehicles      (M,) number of blocking vehicles
    """

    distance: Array
    states: Integers
    lower: Array
    upper: Array
    tops: Array
    vehicles: Integers

    def __post_init__(self) -> None:
        self.distance = np.maximum(self.distance, 1.0)

    @classmethod
    def in_sight(cls, distance: Array, lower: Array, upper: Array) -> LinkGeometry:
        """Return the geometry of links without bodies in between."""
        count = len(distance)
        states, tops, vehicles = np.full(count, LOS), np.full(count, -np.inf), np.zeros(count, dtype=np.int64)
        return cls(distance, states, lower, upper, tops, vehicles)


class Tr37885(Settings):
    """Path loss of 3GPP TR 37.885: LOS in streets or on highways, NLOS behind buildings, NLOSv behind vehicles.

    blockage  distribution of the loss by blocking vehicles: `lognormal` as in ns-3, `normal` with a minimum of 0 dB,
              or its `mean`
    """

    kind: Literal["tr37885"] = "tr37885"
    environment: Literal["urban", "highway"] = "urban"
    blockage: Literal["lognormal", "normal", "mean"] = "lognormal"

    spreads: ClassVar[tuple[float, float, float]] = (3.0, 3.0, 4.0)
    """Standard deviation of the shadowing with LOS, NLOSv and NLOS [dB] (table 6.2.1-2)."""

    @property
    def reaches(self) -> tuple[float, float, float]:
        """Decorrelation distance of the shadowing (correlation 1/e), with LOS, NLOSv and NLOS [m]."""
        return (10.0, 13.0, 13.0) if self.environment == "urban" else (25.0, 25.0, 25.0)

    def loss(self, between: LinkGeometry, frequency_ghz: float, draws: Array) -> Array:
        """Return the path loss without shadowing (M,) [dB]; `draws` (M,) in (0, 1) sample the loss by vehicles."""
        los = urban_los if self.environment == "urban" else highway_los
        clear = los(between.distance, frequency_ghz)
        if not between.states.any():
            return clear
        mean, spread = blockage_moments(between.distance, between.lower, between.upper, between.tops)
        return np.select(
            [between.states == LOS, between.states == NLOSV],
            [clear, clear + self._blockage_loss(mean, spread, draws)],
            building_nlos(between.distance, frequency_ghz),
        )

    def _blockage_loss(self, mean: Array, spread: Array, draws: Array | float) -> Array:
        if self.blockage == "mean":
            return mean
        from scipy.special import ndtri

        if self.blockage == "normal":
            return np.maximum(0.0, mean + spread * ndtri(draws))
        positive = np.where(mean > 0.0, mean, 1.0)
        variance = np.log1p((spread / positive) ** 2)
        lognormal = np.exp(np.log(positive) - variance / 2.0 + np.sqrt(variance) * ndtri(draws))
        return np.where(mean > 0.0, lognormal, 0.0)


class _LossPerVehicle(Settings):
    """Base class of path loss models with a fixed loss per blocking vehicle (ETSI TR 103 257: 6.9 dB).

    Behind buildings the larger of this loss and the NLOS loss of TR 37.885 applies.
    """

    per_vehicle_db: Annotated[float, Field(ge=0.0, le=1000.0)] = 6.9

    spreads: ClassVar[tuple[float, float, float]] = (3.0, 3.0, 4.0)
    """Standard deviation of the shadowing with LOS, NLOSv and NLOS [dB]."""
    reaches: ClassVar[tuple[float, float, float]] = (25.0, 25.0, 25.0)
    """Decorrelation distance of the shadowing (correlation 1/e), with LOS, NLOSv and NLOS [m]."""

    @abstractmethod
    def line_of_sight_loss(self, between: LinkGeometry, frequency_ghz: float) -> Array:
        """Return the path loss of links with LOS (M,) [dB]."""

    def loss(self, between: LinkGeometry, frequency_ghz: float, draws: Array) -> Array:
        """Return the path loss without shadowing (M,) [dB]; `draws` has no effect."""
        clear = self.line_of_sight_loss(between, frequency_ghz)
        if not between.states.any():
            return clear
        return np.select(
            [between.states == LOS, between.states == NLOSV],
            [clear, clear + self.per_vehicle_db * between.vehicles],
            np.maximum(clear, building_nlos(between.distance, frequency_ghz)),
        )


class WinnerB1(_LossPerVehicle):
    """Path loss of WINNER+ B1 as in 3GPP TR 36.885, with a fixed loss per blocking vehicle.

    environment_height  height subtracted from the antenna heights [m]: 1.0 in 3GPP; 0.5 and 0 in the analytic models
                        of 802.11p and C-V2X. It changes the loss at 200 m by 16 dB

    Antennas below ANTENNA_HEIGHT count as at this height, the lowest of the model.
    The NLOS loss is that of TR 37.885, because that of TR 36.885 requires the positions of street corners.
    """

    kind: Literal["winner_b1"]
    environment_height: Annotated[float, Field(ge=0.0, lt=ANTENNA_HEIGHT)] = 1.0

    def line_of_sight_loss(self, between: LinkGeometry, frequency_ghz: float) -> Array:
        """Return the path loss of links with LOS (M,) [dB]."""
        lower, upper = (
            np.maximum(height, ANTENNA_HEIGHT) - self.environment_height for height in (between.lower, between.upper)
        )
        return winner_b1(between.distance, frequency_ghz, lower, upper)


class LogDistance(_LossPerVehicle):
    """Log-distance path loss, with a fixed loss per blocking vehicle.

    exponent            slope: 10 `exponent` dB per decade of distance; 2 is free space
    reference_distance  distance up to which the loss is `reference_loss_db` [m]
    reference_loss_db   [dB]; None: free-space loss at the carrier frequency
    """

    kind: Literal["log_distance"]
    exponent: Annotated[float, Field(gt=0.0, le=10.0)] = 3.0
    reference_distance: Annotated[float, Field(ge=1.0, le=1000.0)] = 1.0
    reference_loss_db: Annotated[float, Field(ge=-200.0, le=1000.0)] | None = None

    def line_of_sight_loss(self, between: LinkGeometry, frequency_ghz: float) -> Array:
        """Return the path loss of links with LOS (M,) [dB]."""
        reference = self.reference_loss_db
        at_reference = free_space(self.reference_distance, frequency_ghz) if reference is None else reference
        return log_distance(between.distance, self.exponent, self.reference_distance, at_reference)


PathLoss = Annotated[Tr37885 | WinnerB1 | LogDistance, Field(discriminator="kind")]


Shape = Annotated[float, Field(ge=0.5, le=1000.0)]


class NoFading(Settings):
    """No fading: every message has the power of the link budget."""

    kind: Literal["none"] = "none"


class Nakagami(Settings):
    """Nakagami-m fading: the power is gamma distributed with shape m around its mean (M. Nakagami, 1960).

    m          shape, at least 0.5 (1: Rayleigh fading; infinity: no fading), or one shape per distance range
    distances  boundaries between the distance ranges [m], one fewer than shapes
    """

    kind: Literal["nakagami"]
    m: tuple[Shape, ...]
    distances: tuple[Annotated[float, Field(gt=0.0)], ...] = ()

    @field_validator("m", mode="before", json_schema_input_type=tuple[Shape, ...] | Shape)
    @classmethod
    def _wrap_single_shape(cls, value: object) -> object:
        return (value,) if isinstance(value, int | float | str) else value

    @model_validator(mode="after")
    def _check_ranges(self) -> Nakagami:
        if len(self.m) != len(self.distances) + 1 or list(self.distances) != sorted(set(self.distances)):
            counts = f"{len(self.distances)} distances and {len(self.m)} values of m"
            raise ValueError(f"distances must be ascending, one fewer than values of m (got {counts})")
        return self

    def gain_db(self, distance: Array, draws: Array) -> Array:
        """Return the fading gain (N,) [dB] at these distances [m]; `draws` (N,) in (0, 1)."""

        from scipy.special import gammaincinv

        shape = np.array(self.m)[np.searchsorted(self.distances, distance, side="right")]
        gain: Array = 10.0 * np.log10(np.maximum(gammaincinv(shape, draws) / shape, 1e-30))
        return gain


Fading = Annotated[NoFading | Nakagami, Field(discriminator="kind")]


class FadingDraws:
    """Random fading of messages between N stations, keyed by link and message number."""

    def __init__(self, fading: Nakagami, seed: int) -> None:
        self._fading = fading
        self._seed = seed
        self._keys: Keys = np.zeros((0, 0), dtype=np.uint64)
        self.distance: Array = np.zeros((0, 0))
        """Current distance between the antennas (N, N) [m]."""

    def rearrange(self, names: tuple[str, ...]) -> None:
        """Replace the stations."""
        own = np.array([key(self._seed, "fading", name) for name in names], dtype=np.uint64)
        self._keys = combine_keys(own[:, None], own[None, :])

    def gain_db(self, row: int, number: int) -> Array:
        """Return the fading gain (N,) of message `number` of the station in `row` at each station [dB]."""
        return self._fading.gain_db(self.distance[row], uniforms(self._keys[row], number))
