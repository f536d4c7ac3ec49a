"""Settings of the radio channel."""

from __future__ import annotations

import math
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
from eidrive_scenario.v2x.standards import (
    ANTENNA_HEIGHT,
    BITS_PER_SYMBOL,
    NOISE_DBM,
    RESOURCE_BLOCKS,
    SENSING_DBM,
    SENSITIVITIES,
    SUBFRAME,
    ieee80211p_airtime,
)

Technology = Literal["80211p", "cv2x_mode4"]
Level = Annotated[float, Field(ge=-200.0, le=100.0)]
"""Received power [dBm]."""
Background = Annotated[Ieee80211pLoss | Cv2xMode4Loss, Field(discriminator="kind")]

_CURVES = {
    "80211p": ("80211p_highway_los", "80211p_highway_nlos", "80211p_crossing_nlos"),
    "cv2x_mode4": ("cv2x_r0.7",) * 3,
}
_IDLE = {"80211p": {"sidelink"}, "cv2x_mode4": {"data_rate_mbps", "mtu", "jammers"}}
"""Settings without effect, by technology."""


INTERVALS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Resource reservation intervals [s]."""
PSCCH_BLOCKS = 2
"""Number of resource blocks of the control channel in the first subchannel (3GPP TS 36.213, 14.2)."""
MAX_SELECTION_WINDOW = 0.1
"""Maximum T2 [s] (3GPP TS 36.213, 14.1.1.6)."""


class SidelinkSettings(Settings):
    """Settings of the resource pool of C-V2X Mode 4 (10 MHz) and of the resource selection.

    interval      resource reservation interval [s]
    subchannels   number of subchannels in 10 MHz
    subchannel_bytes   capacity of one subchannel in a subframe of 1 ms [bytes]
    resource_keep_probability   probability of keeping the resource when the reselection counter reaches 0
                  (probResourceKeep)
    processing    time from the message to the earliest subframe that can carry it [s]; T1 of the selection window
    selection_window   T2, the end of the selection window, after the request [s]; None: the interval, at most 100 ms
    latency       latency requirement [s]: if the next reserved resource is later than this after the message could be
                  sent, the station selects a new one
    reselect_after     number of consecutive unused resources after which a station selects a new one
                  (sl-ReselectAfter); None: no such limit
    pssch_rsrp_threshold_dbm   SL-ThresPSSCH-RSRP, above which a decoded reservation excludes resources; it is raised by
                  3 dB while less than 20 % remain [dBm per resource element]
    cbr_threshold_dbm  S-RSSI above which a subchannel counts as busy [dBm] (ETSI TS 103 574, 5.2)
    pscch_errors  name of the packet error curve of the control channel
    """

    interval: float = 0.1
    subchannels: Annotated[int, Field(ge=1, le=20)] = 4
    subchannel_bytes: Annotated[int, Field(ge=1)] = 190
    resource_keep_probability: Annotated[float, Field(ge=0.0, le=0.8)] = 0.0
    processing: Annotated[float, Field(ge=0.0, le=0.004)] = 0.001
    selection_window: Annotated[float, Field(ge=0.02, le=MAX_SELECTION_WINDOW)] | None = None
    latency: Annotated[float, Field(gt=0.0)] = 0.1
    reselect_after: Annotated[int, Field(ge=1, le=9)] | None = None
    pssch_rsrp_threshold_dbm: Annotated[float, Field(ge=-128.0, le=-2.0)] = -128.0
    cbr_threshold_dbm: Annotated[float, Field(ge=-112.0, le=-22.0)] = -94.0
    pscch_errors: str = "pscch"

    @model_validator(mode="after")
    def _standard(self) -> SidelinkSettings:
        if self.interval not in INTERVALS:
            raise ValueError(
                f"interval is not supported (got {self.interval:g} s; "
                f"expected one of {', '.join(f'{interval:g}' for interval in INTERVALS)})"
            )
        if self.pscch_errors not in CURVES:
            raise ValueError(
                f"unknown packet error curve {self.pscch_errors!r}; {suggestion(self.pscch_errors, CURVES)}"
            )
        return self

    @property
    def interval_subframes(self) -> int:
        """Resource reservation interval in subframes."""
        return round(self.interval / SUBFRAME)

    @property
    def window_subframes(self) -> int:
        """T2 in subframes."""
        window = min(self.interval, MAX_SELECTION_WINDOW) if self.selection_window is None else self.selection_window
        return round(window / SUBFRAME)

    @property
    def counter_range(self) -> tuple[int, int]:
        """Minimum and maximum reselection counter (3GPP TS 36.321, 5.14.1.1)."""
        factor = max(1, round(0.1 / self.interval))
        return 5 * factor, 15 * factor

    @property
    def control_curve(self) -> ErrorCurve:
        """Packet error curve of the control channel."""
        return CURVES[self.pscch_errors]

    def extent(self, size: int) -> tuple[int, int]:
        """Return the numbers of subchannels and of subframes that a message of `size` bytes occupies."""
        needed = max(1, math.ceil(size / self.subchannel_bytes))
        return min(needed, self.subchannels), math.ceil(needed / self.subchannels)

    def pssch_blocks(self, width: int) -> int:
        """Return the number of resource blocks for the data of a transmission in `width` subchannels.

        3GPP TS 36.213, 14.1.1.4C: largest product of powers of 2, 3 and 5 without the blocks of the control channel.
        """
        blocks = max(1, RESOURCE_BLOCKS // self.subchannels * width - PSCCH_BLOCKS)
        while not _is_regular(blocks):
            blocks -= 1
        return blocks


def _is_regular(number: int) -> bool:
    for prime in (2, 3, 5):
        while number % prime == 0:
            number //= prime
    return number == 1


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

    technology     80211p (carrier sensing) or cv2x_mode4 (semi-persistent scheduling)
    frequency_ghz, tx_power_dbm, antenna_gain_dbi   carrier, transmitter, and gain of each of the two antennas
    noise_dbm      noise in 10 MHz [dBm];  sensing_dbm  minimum sensed power, None: that of the technology (-85 or
                   -90.5 dBm)
    path_loss      path loss model and its settings
    line_of_sight  `rays` through the world, `random` by the probabilities of TR 37.885, `clear`
    shadowing_db   standard deviation; None: that of the path loss model, 0: no shadowing
    decorrelation  decorrelation distance of the shadowing [m]
    fading         fading of each message at each receiver, relative to the link budget
    packet_errors  name of one curve, or a mapping from los, nlosv and nlos to one each; None: that of the technology
    data_rate_mbps data rate of 802.11p;  mtu  maximum frame size [bytes]
    jitter         maximum of the uniform random time from the tick until a message is ready [s]
    sidelink       resource pool and selection of C-V2X Mode 4
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
        if self.background is not None and self.background.kind != self.technology:
            raise ValueError(f"background.kind must be {self.technology}, as technology (got {self.background.kind})")
        idle = self.model_fields_set & _IDLE[self.technology]
        if idle:
            raise ValueError(f"{min(idle)} has no effect with technology {self.technology}")
        return self

    @property
    def sensing(self) -> float:
        """Minimum sensed power [dBm]."""
        return SENSING_DBM[self.technology] if self.sensing_dbm is None else self.sensing_dbm

    @property
    def noise(self) -> float:
        """Noise in the band of a message [dBm]; with C-V2X in one subchannel, 10 of 50 resource blocks."""
        return self.noise_in(1)

    def noise_in(self, width: int) -> float:
        """Return the noise in the band of a message in `width` subchannels [dBm]."""
        if self.technology == "80211p":
            return self.noise_dbm
        return self.noise_dbm - 10.0 * float(np.log10(RESOURCE_BLOCKS / self.sidelink.pssch_blocks(width)))

    @property
    def max_subchannels(self) -> int:
        """Maximum number of subchannels of a message; 1 with 802.11p."""
        return 1 if self.technology == "80211p" else self.sidelink.subchannels

    @property
    def radiated(self) -> float:
        """Transmitted power with the gain of both antennas [dBm]."""
        return self.tx_power_dbm + 2.0 * self.antenna_gain_dbi

    @property
    def curves(self) -> tuple[ErrorCurve, ErrorCurve, ErrorCurve]:
        """Packet error curves with LOS, NLOSv and NLOS.

        Those of 802.11p are known for 6 Mbit/s. At another data rate they are shifted by the difference of the minimum
        sensitivities in the standard.
        """
        chosen = self.packet_errors
        los, nlosv, nlos = _CURVES[self.technology] if chosen is None else (chosen.los, chosen.nlosv, chosen.nlos)
        by = SENSITIVITIES[self.data_rate_mbps] - SENSITIVITIES[CURVE_RATE_MBPS]
        curves = {name: CURVES[name].shifted(by) if by else CURVES[name] for name in (los, nlosv, nlos)}
        return curves[los], curves[nlosv], curves[nlos]

    def airtime(self, size: int) -> float:
        """Return the duration of the transmission of a message of `size` bytes [s]."""
        if self.technology == "80211p":
            return ieee80211p_airtime(size, self.data_rate_mbps, self.mtu)
        return SUBFRAME * self.sidelink.extent(size)[1]

    def background_by_loss(self) -> tuple[ErrorTable, Array] | None:
        """Return the error table of the background traffic, and the LOS path loss at each of its distances [dB]."""
        if self.background is None:
            return None
        table = self.background.table()
        heights = np.full(len(table.distance), ANTENNA_HEIGHT)
        between = LinkGeometry.in_sight(table.distance, heights, heights)
        los_loss = self.path_loss.loss(between, self.frequency_ghz, np.full(len(heights), 0.5))
        return table, np.maximum.accumulate(los_loss)

    def jamming_power(self, positions: Array) -> Array:
        """Return the power (N,) [mW] that antennas at `positions` (N, 3) receive from all jammers, in line of sight."""
        total = np.zeros(len(positions))
        for jammer in self.jammers:
            antenna = np.array([jammer.x, jammer.y, jammer.z])
            heights, distance = positions[:, 2], np.linalg.norm(positions - antenna, axis=1)
            between = LinkGeometry.in_sight(distance, np.minimum(heights, jammer.z), np.maximum(heights, jammer.z))
            loss = self.path_loss.loss(between, self.frequency_ghz, np.full(len(positions), 0.5))
            total += 10.0 ** ((jammer.power_dbm + self.antenna_gain_dbi - loss) / 10.0)
        return total
