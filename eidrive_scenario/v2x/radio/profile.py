"""Settings of the radio channel."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt, model_validator

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.errors import suggestion
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.analytic.settings import Cv2xMode4Loss, Ieee80211pLoss
from eidrive_scenario.v2x.analytic.table import ErrorTable
from eidrive_scenario.v2x.link_models.composed import ComposedProfile
from eidrive_scenario.v2x.propagation import Fading, LinkGeometry, NoFading, PathLoss, Tr37885
from eidrive_scenario.v2x.radio.access import QueueSettings
from eidrive_scenario.v2x.radio.congestion import CongestionControl, NoDcc
from eidrive_scenario.v2x.radio.packet_error import CURVE_RATE_MBPS, CURVES, ErrorCurve
from eidrive_scenario.v2x.radio.resource_pool import NrSidelinkSettings, Pool, SidelinkSettings
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.standards import (
    ANTENNA_HEIGHT,
    BITS_PER_SYMBOL,
    NOISE_DBM,
    SENSING_DBM,
    SENSITIVITIES,
    ieee80211p_airtime,
)

Technology = Literal["80211p", "cv2x_mode4", "nr_v2x_mode2"]
Level = Annotated[float, Field(ge=-200.0, le=100.0)]
"""Received power [dBm]."""
Background = Annotated[Ieee80211pLoss | Cv2xMode4Loss, Field(discriminator="kind")]

_CURVES = {
    "80211p": ("80211p_highway_los", "80211p_highway_nlos", "80211p_crossing_nlos"),
    "cv2x_mode4": ("cv2x_r0.7",) * 3,
}
_IDLE = {
    "80211p": {"sidelink", "nr_sidelink"},
    "cv2x_mode4": {"nr_sidelink", "data_rate_mbps", "mtu", "jammers"},
    "nr_v2x_mode2": {"sidelink", "data_rate_mbps", "mtu", "jammers", "background"},
}
"""Settings without effect, by technology."""


class PacketErrors(Settings):
    """Names of packet error curves by line-of-sight state.

    `eidrive_scenario.v2x.radio.packet_error` lists the curves with their sources.
    """

    los: str
    nlosv: str
    nlos: str

    @model_validator(mode="after")
    def _check_names(self) -> PacketErrors:
        for name in (self.los, self.nlosv, self.nlos):
            if name not in CURVES:
                raise ValueError(f"unknown packet error curve {name!r}; {suggestion(name, CURVES)}")
        return self


def _one_curve(value: Any) -> Any:
    """Return the name of one curve as that of all states."""
    return {"los": value, "nlosv": value, "nlos": value} if isinstance(value, str) else value


Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


class Jammer(Settings):
    """Continuous noise in the 10 MHz of the channel, from a fixed place. It blocks carrier sensing, too.

    x, y, z    place of its antenna in the world frame [m]
    power_dbm  radiated power with the gain of its antenna (EIRP) [dBm]
    """

    x: Coordinate
    y: Coordinate
    z: Annotated[float, Field(ge=0.0, le=1000.0)] = 1.5
    power_dbm: Annotated[float, Field(ge=-30.0, le=80.0)] = 30.0


class RadioProfile(ComposedProfile):
    """Settings of a radio channel; `delay` and `loss` apply in addition to the radio model.

    technology     80211p (carrier sensing), cv2x_mode4 or nr_v2x_mode2 (semi-persistent scheduling)
    frequency_ghz, tx_power_dbm, antenna_gain_dbi   carrier, transmitter, and gain of each of the two antennas
    noise_dbm      noise in 10 MHz [dBm];  sensing_dbm  minimum sensed power, None: that of the technology (-85,
                   -90.5 or -130 dBm)
    path_loss      path loss model and its settings
    line_of_sight  `rays` through the world, `random` by the probabilities of TR 37.885, `clear`
    shadowing_db   standard deviation; None: that of the path loss model, 0: no shadowing
    decorrelation  decorrelation distance of the shadowing [m]
    fading         fading of each message at each receiver, relative to the link budget
    packet_errors  name of one curve, or a mapping from los, nlosv and nlos to one each; None: that of the technology
    data_rate_mbps data rate of 802.11p;  mtu  maximum frame size [bytes]
    jitter         maximum of the uniform random time from the tick until a message is ready [s]
    sidelink       resource pool and selection of C-V2X Mode 4
    nr_sidelink    carrier, resource pool and selection of NR-V2X Mode 2
    queue          transmit queue;  congestion  congestion control
    background     background traffic that is not simulated, by one of the analytic models
    jammers        transmitters of noise, with 802.11p
    """

    model: Literal["radio"] = "radio"  # type: ignore[assignment]
    technology: Technology = "80211p"
    frequency_ghz: Annotated[float, Field(ge=0.5, le=100.0)] = 5.9
    tx_power_dbm: Annotated[float, Field(ge=-30.0, le=50.0)] = 23.0
    antenna_gain_dbi: Annotated[float, Field(ge=-100.0, le=100.0)] = 3.0
    noise_dbm: Level = NOISE_DBM
    sensing_dbm: Level | None = None
    path_loss: PathLoss = Tr37885()
    line_of_sight: Literal["rays", "random", "clear"] = "rays"
    shadowing_db: Annotated[float, Field(ge=0.0, le=30.0)] | None = None
    decorrelation: PositiveFloat | None = None
    fading: Fading = NoFading()
    packet_errors: Annotated[PacketErrors | None, BeforeValidator(_one_curve, PacketErrors | str | None)] = None
    data_rate_mbps: float = 6.0
    mtu: PositiveInt = 1400
    jitter: Annotated[float, Field(ge=0.0, le=10.0)] = 0.01
    sidelink: SidelinkSettings = SidelinkSettings()
    nr_sidelink: NrSidelinkSettings = NrSidelinkSettings()
    queue: QueueSettings = QueueSettings()
    congestion: CongestionControl = NoDcc()
    background: Background | None = None
    jammers: Annotated[tuple[Jammer, ...], Field(max_length=100)] = ()

    @model_validator(mode="after")
    def _check_combination(self) -> RadioProfile:
        if self.data_rate_mbps not in BITS_PER_SYMBOL:
            rates = ", ".join(f"{rate:g}" for rate in BITS_PER_SYMBOL)
            raise ValueError(f"data_rate_mbps is not supported (got {self.data_rate_mbps:g}; expected one of {rates})")
        if self.own_perception:
            raise ValueError(
                "own_perception has no effect with model radio (a station cannot receive its own messages)"
            )
        defaults = {name: type(self).model_fields[name].default for name in _IDLE[self.technology]}
        # resolved settings, of which sweeps change some, contain the default values
        idle = [name for name, default in defaults.items() if getattr(self, name) != default]
        if idle:
            raise ValueError(f"{min(idle)} has no effect with technology {self.technology}")
        if self.background is not None and self.background.kind != self.technology:
            raise ValueError(f"background.kind must be {self.technology}, as technology (got {self.background.kind})")
        return self

    @property
    def sensing(self) -> float:
        """Minimum sensed power [dBm]."""
        return SENSING_DBM[self.technology] if self.sensing_dbm is None else self.sensing_dbm

    @property
    def noise(self) -> float:
        """Noise in the band of a message [dBm]; with a sidelink in one subchannel."""
        return self.noise_in(1)

    @property
    def pool(self) -> Pool | None:
        """Resource pool of the technology; None with 802.11p."""
        if self.technology == "80211p":
            return None
        return self.sidelink if self.technology == "cv2x_mode4" else self.nr_sidelink

    def noise_in(self, width: int) -> float:
        """Return the noise in the band of a message in `width` subchannels [dBm]."""
        if self.pool is None:
            return self.noise_dbm
        return self.noise_dbm - 10.0 * float(np.log10(self.pool.noise_blocks / self.pool.pssch_blocks(width)))

    @property
    def max_subchannels(self) -> int:
        """Maximum number of subchannels of a message; 1 with 802.11p."""
        return 1 if self.pool is None else self.pool.subchannels

    @property
    def radiated(self) -> float:
        """Transmitted power with the gain of both antennas [dBm]."""
        return self.tx_power_dbm + 2.0 * self.antenna_gain_dbi

    @property
    def curves(self) -> tuple[ErrorCurve, ErrorCurve, ErrorCurve]:
        """Packet error curves with LOS, NLOSv and NLOS.

        Those of 802.11p are known for 6 Mbit/s. At another data rate they are shifted by the difference of the minimum
        sensitivities in the standard. That of NR-V2X is the one of its modulation and code rate.
        """
        chosen = self.packet_errors
        if chosen is None and self.technology == "nr_v2x_mode2":
            return (self.nr_sidelink.data_curve,) * 3
        los, nlosv, nlos = _CURVES[self.technology] if chosen is None else (chosen.los, chosen.nlosv, chosen.nlos)
        by = SENSITIVITIES[self.data_rate_mbps] - SENSITIVITIES[CURVE_RATE_MBPS]
        curves = {name: CURVES[name].shifted(by) if by else CURVES[name] for name in (los, nlosv, nlos)}
        return curves[los], curves[nlosv], curves[nlos]

    def airtime(self, size: int) -> float:
        """Return the duration of the transmission of a message of `size` bytes [s]."""
        if self.pool is None:
            return ieee80211p_airtime(size, self.data_rate_mbps, self.mtu)
        return self.pool.slot * self.pool.extent(size)[1]

    def background_by_loss(self) -> tuple[ErrorTable, Array] | None:
        """Return the error table of the background traffic, and the LOS path loss at each of its distances [dB]."""
        if self.background is None:
            return None
        table = self.background.table()
        heights = np.full(len(table.distance), ANTENNA_HEIGHT)
        between = LinkGeometry.in_sight(table.distance, heights, heights)
        los_loss = self.path_loss.loss(between, self.frequency_ghz, np.full(len(heights), 0.5))
        return table, np.maximum.accumulate(los_loss)

    def jamming_power(self, surroundings: RadioEnvironment) -> Array:
        """Return the power (N,) [mW] that the stations receive from all jammers, in line of sight."""
        positions, heights = surroundings.positions, surroundings.heights
        total = np.zeros(len(positions))
        for jammer in self.jammers:
            antenna = np.array([jammer.x, jammer.y, jammer.z])
            distance = np.linalg.norm(positions - antenna, axis=1)
            other = jammer.z - (positions[:, 2] - heights)  # above the ground of the station; its own is unknown
            between = LinkGeometry.in_sight(distance, np.minimum(heights, other), np.maximum(heights, other))
            loss = self.path_loss.loss(between, self.frequency_ghz, np.full(len(positions), 0.5))
            total += 10.0 ** ((jammer.power_dbm + self.antenna_gain_dbi - loss) / 10.0)
        return total
