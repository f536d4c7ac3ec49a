"""Settings of the path loss: published model and additional loss by blocking bodies."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.propagation.gains import (
    blockage_moments,
    building_nlos,
    free_space,
    highway_los,
    log_distance,
    urban_los,
    winner_b1,
)
from eidrive_scenario.v2x.radio_environment import LOS, NLOSV
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT


class LinkGeometry:
    """Geometry of M links; the code of state LOS is 0.

    distance      (M,) distance between the antennas [m]
    states        (M,) LOS, NLOSV or NLOS
    lower, upper  (M,) heights of the lower and the higher antenna [m]
    tops          (M,) top of the highest blocking vehicle [m]
    vehicles      (M,) number of blocking vehicles
    """

    def __init__(
        self, distance: Array, states: Integers, lower: Array, upper: Array, tops: Array, vehicles: Integers
    ) -> None:
        self.distance = np.maximum(distance, 1.0)
        self.states = states
        self.lower = lower
        self.upper = upper
        self.tops = tops
        self.vehicles = vehicles


class Link(NamedTuple):
    """One link of `LinkGeometry`, in Python numbers."""

    distance: float
    state: int
    lower: float
    upper: float
    top: float
    vehicles: int


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

    def loss_of(self, link: Link, frequency_ghz: float, draw: float) -> float:
        """Return the path loss without shadowing of one link [dB]."""
        distance = max(link.distance, 1.0)
        los = urban_los if self.environment == "urban" else highway_los
        if link.state == LOS:
            return float(los(distance, frequency_ghz))
        if link.state != NLOSV:
            return float(building_nlos(distance, frequency_ghz))
        mean, spread = blockage_moments(distance, link.lower, link.upper, link.top)
        return float(los(distance, frequency_ghz) + self._blockage_loss(mean, spread, draw))

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
    def line_of_sight_loss(self, distance: Array | float, frequency_ghz: float) -> Array:
        """Return the path loss with LOS [dB] at distances [m]."""

    def loss(self, between: LinkGeometry, frequency_ghz: float, draws: Array) -> Array:
        """Return the path loss without shadowing (M,) [dB]; `draws` has no effect."""
        clear = self.line_of_sight_loss(between.distance, frequency_ghz)
        if not between.states.any():
            return clear
        return np.select(
            [between.states == LOS, between.states == NLOSV],
            [clear, clear + self.per_vehicle_db * between.vehicles],
            np.maximum(clear, building_nlos(between.distance, frequency_ghz)),
        )

    def loss_of(self, link: Link, frequency_ghz: float, draw: float) -> float:
        """Return the path loss without shadowing of one link [dB]."""
        distance = max(link.distance, 1.0)
        clear = float(self.line_of_sight_loss(distance, frequency_ghz))
        if link.state == LOS:
            return clear
        if link.state == NLOSV:
            return clear + self.per_vehicle_db * link.vehicles
        return max(clear, float(building_nlos(distance, frequency_ghz)))


class WinnerB1(_LossPerVehicle):
    """Path loss of WINNER+ B1 as in 3GPP TR 36.885, with a fixed loss per blocking vehicle.

    environment_height  height subtracted from the antenna heights [m]: 1.0 in 3GPP; 0.5 and 0 in the analytic models
                        of 802.11p and C-V2X. It changes the loss at 200 m by 16 dB

    The NLOS loss is that of TR 37.885, because that of TR 36.885 requires the positions of street corners.
    """

    kind: Literal["winner_b1"]
    environment_height: Annotated[float, Field(ge=0.0, lt=ANTENNA_HEIGHT)] = 1.0

    def line_of_sight_loss(self, distance: Array | float, frequency_ghz: float) -> Array:
        """Return the path loss with LOS [dB] at distances [m], for antennas at ANTENNA_HEIGHT."""
        height = ANTENNA_HEIGHT - self.environment_height
        return winner_b1(distance, frequency_ghz, height, height)


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

    def line_of_sight_loss(self, distance: Array | float, frequency_ghz: float) -> Array:
        """Return the path loss with LOS [dB] at distances [m]."""
        reference = self.reference_loss_db
        at_reference = free_space(self.reference_distance, frequency_ghz) if reference is None else reference
        return log_distance(distance, self.exponent, self.reference_distance, at_reference)


PathLoss = Annotated[Tr37885 | WinnerB1 | LogDistance, Field(discriminator="kind")]
