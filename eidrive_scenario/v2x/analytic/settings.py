"""Settings of the analytic models: loss of the composed channel, background load of the radio channel."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.analytic.cv2x_mode4 import cv2x_mode4_errors
from eidrive_scenario.v2x.analytic.ieee80211p import FULL, ieee80211p_errors, offered_load
from eidrive_scenario.v2x.analytic.table import ErrorTable
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT, CANDIDATE_SHARE

FARTHEST, STEP = 1000.0, 10.0
"""Maximum distance and step of the tables [m]; neither model delivers packets beyond."""

Density = Annotated[float, Field(gt=0.0, le=1.0)]
Power = Annotated[float, Field(ge=-30.0, le=50.0)]
"""Transmission power in the range of `tx_power_dbm` of the radio [dBm]."""


class Ieee80211pLoss(Settings):
    """Loss of IEEE 802.11p messages among other vehicles, by distance (Sepulcre et al. 2021).

    density    vehicles per meter of road
    rate, size, power_dbm, data_rate_mbps   traffic of each vehicle: packets per second, bytes, dBm, Mbit/s
    environment_height   height subtracted from the antenna height of 1.5 m in the path loss [m]
    """

    kind: Literal["80211p"]
    density: Density
    rate: PositiveFloat = 10.0
    size: PositiveInt = 300
    power_dbm: Power = 23.0
    data_rate_mbps: PositiveFloat = 6.0
    environment_height: Annotated[float, Field(ge=0.0, lt=ANTENNA_HEIGHT)] = 0.5

    @model_validator(mode="after")
    def _check_load(self) -> Ieee80211pLoss:
        height = ANTENNA_HEIGHT - self.environment_height
        bit_rate = self.data_rate_mbps * 1e6
        load = offered_load(self.density, self.rate, self.size, self.power_dbm, bit_rate, height)
        if load > FULL:
            raise ValueError(
                f"density, rate and size: the offered load exceeds the range of the model (got {load:.3g}; "
                f"expected at most {FULL:.3g})"
            )
        return self

    def table(self) -> ErrorTable:
        """Return the error probabilities by distance."""
        return _table(self)


class Cv2xMode4Loss(Settings):
    """Loss of C-V2X Mode 4 messages of 190 bytes among other vehicles, by distance (Gonzalez-Martín et al. 2019).

    density    vehicles per meter of road
    rate, power_dbm   traffic of each vehicle: packets per second (published for 10 and 20; at most
                      one per subframe), dBm
    subchannels   4 (QPSK, r = 0.7) or 2 (r = 0.5)
    environment_height   height subtracted from the antenna height of 1.5 m in the path loss [m]
    """

    kind: Literal["cv2x_mode4"]
    density: Density
    rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 10.0
    power_dbm: Power = 20.0
    subchannels: Literal[2, 4] = 4
    environment_height: Annotated[float, Field(ge=0.0, lt=ANTENNA_HEIGHT)] = 0.0

    @model_validator(mode="after")
    def _check_load(self) -> Cv2xMode4Loss:
        busy = self.table().channel_busy_ratio
        if busy > 1.0 - CANDIDATE_SHARE:
            raise ValueError(
                f"density and rate: the reserved share of the resources exceeds the range of the model "
                f"(got {busy:.3g}; expected at most {1.0 - CANDIDATE_SHARE:g})"
            )
        return self

    def table(self) -> ErrorTable:
        """Return the error probabilities by distance."""
        return _table(self)


_DISTANCES = np.arange(0.0, FARTHEST + STEP / 2.0, STEP)


@cache
def _table(loss: Ieee80211pLoss | Cv2xMode4Loss) -> ErrorTable:
    traffic = {"density": loss.density, "rate": loss.rate, "power": loss.power_dbm}
    height = loss.environment_height
    if isinstance(loss, Cv2xMode4Loss):
        return cv2x_mode4_errors(_DISTANCES, **traffic, subchannels=loss.subchannels, environment_height=height)
    bit_rate = loss.data_rate_mbps * 1e6
    return ieee80211p_errors(_DISTANCES, **traffic, size=loss.size, bit_rate=bit_rate, environment_height=height)
