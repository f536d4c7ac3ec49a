"""The settings of a radio."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from eidrive_scenario.arrays import Array
from eidrive_scenario.errors import suggestion
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.analytic.settings import FARTHEST, STEP, Cv2xMode4Loss, Ieee80211pLoss
from eidrive_scenario.v2x.analytic.table import ErrorTable
from eidrive_scenario.v2x.link_models.composed import ComposedProfile
from eidrive_scenario.v2x.propagation.fading import Fading, NoFading
from eidrive_scenario.v2x.propagation.path_loss import LinkGeometry, PathLoss, Tr37885
from eidrive_scenario.v2x.radio.access import QueueSettings
from eidrive_scenario.v2x.radio.airtime import BITS_PER_SYMBOL, SUBFRAME, ieee80211p_airtime
from eidrive_scenario.v2x.radio.congestion import CongestionControl, NoDcc
from eidrive_scenario.v2x.radio.packet_error import CURVES, ErrorCurve
from eidrive_scenario.v2x.radio.sidelink.settings import BLOCKS, SidelinkSettings
from eidrive_scenario.v2x.radio_environment import LOS

Technology = Literal["80211p", "cv2x_mode4"]
Level = Annotated[float, Field(ge=-200.0, le=100.0)]
"""Power at a receiver [dBm]."""
Background = Annotated[Ieee80211pLoss | Cv2xMode4Loss, Field(discriminator="kind")]

_SENSING = {"80211p": -85.0, "cv2x_mode4": -90.5}
_CURVES = {
    "80211p": ("80211p_highway_los", "80211p_highway_nlos", "80211p_crossing_nlos"),
    "cv2x_mode4": ("cv2x_r0.7",) * 3,
}
_IDLE = {"80211p": {"sidelink"}, "cv2x_mode4": {"data_rate_mbps", "mtu"}}
"""What has no meaning to each technology."""


class PacketErrors(Settings):
    """Names of curves of packet errors by what stands between the antennas; `eidrive_scenario.v2x.radio.packet_error`
    has them with their sources."""

    los: str
    nlosv: str
    nlos: str

    @model_validator(mode="after")
    def _known(self) -> PacketErrors:
        for name in (self.los, self.nlosv, self.nlos):
            if name not in CURVES:
                raise ValueError(f"no curve of packet errors {name!r}; {suggestion(name, CURVES)}")
        return self


class RadioProfile(ComposedProfile):
    """A radio channel; `delay` and `loss` come on top of what the radio does.

    technology     80211p (listen before talk) or cv2x_mode4 (resources kept for some messages)
    frequency_ghz, tx_power_dbm, antenna_gain_dbi   carrier, transmitter, and gain of each of the two antennas
    noise_dbm      in 10 MHz;  sensing_dbm  least power that is noticed, None is the technology's (-85, -90.5 dBm)
    path_loss      which model, and its settings
    line_of_sight  `rays` through the world, `random` after the probabilities of TR 37.885, `clear`
    shadowing_db   standard deviation, None is the model's, 0 is no shadowing;  decorrelation  its distance [m]
    fading         of each message at each receiver around the link budget
    packet_errors  name of one curve, or a mapping from los, nlosv and nlos to one each; None is the technology's
    data_rate_mbps of 802.11p;  mtu  largest frame [bytes]
    jitter         from the tick to the moment when a message is ready: evenly up to this, anew for each message [s]
    sidelink       resources of C-V2X Mode 4
    queue          what waits at a sender;  congestion  control of the message rate
    background     traffic that is not simulated, by one of the analytic models
    """

    model: Literal["radio"] = "radio"  # type: ignore[assignment]
    technology: Technology = "80211p"
    frequency_ghz: Annotated[float, Field(ge=0.5, le=100.0)] = 5.9
    tx_power_dbm: Annotated[float, Field(ge=-30.0, le=50.0)] = 23.0
    antenna_gain_dbi: Annotated[float, Field(ge=-100.0, le=100.0)] = 3.0
    noise_dbm: Level = -95.0
    sensing_dbm: Level | None = None
    path_loss: PathLoss = Tr37885()
    line_of_sight: Literal["rays", "random", "clear"] = "rays"
    shadowing_db: Annotated[float, Field(ge=0.0, le=30.0)] | None = None
    decorrelation: PositiveFloat | None = None
    fading: Fading = NoFading()
    packet_errors: PacketErrors | None = None
    data_rate_mbps: float = 6.0
    mtu: PositiveInt = 1400
    jitter: Annotated[float, Field(ge=0.0, le=10.0)] = 0.01
    sidelink: SidelinkSettings = SidelinkSettings()
    queue: QueueSettings = QueueSettings()
    congestion: CongestionControl = NoDcc()
    background: Background | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_curve_for_all(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("packet_errors"), str):
            name = data["packet_errors"]
            return {**data, "packet_errors": {"los": name, "nlosv": name, "nlos": name}}
        return data

    @model_validator(mode="after")
    def _fits(self) -> RadioProfile:
        if self.data_rate_mbps not in BITS_PER_SYMBOL:
            rates = ", ".join(f"{rate:g}" for rate in BITS_PER_SYMBOL)
            raise ValueError(f"data_rate_mbps is {self.data_rate_mbps:g}; known: {rates}")
        if self.own_perception:
            raise ValueError("own_perception does not go with a radio: nobody hears its own antenna")
        if self.background is not None and self.background.kind != self.technology:
            raise ValueError(f"the background is {self.background.kind}, the technology {self.technology}")
        idle = self.model_fields_set & _IDLE[self.technology]
        if idle:
            raise ValueError(f"{min(idle)} means nothing to {self.technology}")
        return self

    @property
    def sensing(self) -> float:
        """Least power that is noticed [dBm]."""
        return _SENSING[self.technology] if self.sensing_dbm is None else self.sensing_dbm

    @property
    def noise(self) -> float:
        """In the band of a message [dBm]; with C-V2X, of one in a single subchannel: 10 of 50 resource blocks."""
        return self.noise_in(1)

    def noise_in(self, width: int) -> float:
        """In the band of a message in so many subchannels [dBm]."""
        if self.technology == "80211p":
            return self.noise_dbm
        return self.noise_dbm - 10.0 * float(np.log10(BLOCKS / self.sidelink.pssch_blocks(width)))

    @property
    def most_subchannels(self) -> int:
        """How many a message can take; 802.11p knows only one."""
        return 1 if self.technology == "80211p" else self.sidelink.subchannels

    @property
    def radiated(self) -> float:
        """Transmitted power with the gain of both antennas [dBm]."""
        return self.tx_power_dbm + 2.0 * self.antenna_gain_dbi

    @property
    def curves(self) -> tuple[ErrorCurve, ErrorCurve, ErrorCurve]:
        """Of packet errors with LOS, NLOSv and NLOS."""
        chosen = self.packet_errors
        names = _CURVES[self.technology] if chosen is None else (chosen.los, chosen.nlosv, chosen.nlos)
        return CURVES[names[0]], CURVES[names[1]], CURVES[names[2]]

    def airtime(self, size: int) -> float:
        """How long a message of `size` bytes is on the air [s]."""
        if self.technology == "80211p":
            return ieee80211p_airtime(size, self.data_rate_mbps, self.mtu)
        return SUBFRAME * self.sidelink.extent(size)[1]

    def background_by_loss(self) -> tuple[ErrorTable, Array] | None:
        """The table of the background traffic, and the open path loss at each of its distances [dB]."""
        if self.background is None:
            return None
        distance = np.arange(0.0, FARTHEST + STEP / 2.0, STEP)
        count = len(distance)
        heights, nothing = np.full(count, 1.5), np.zeros(count, dtype=np.int64)
        between = LinkGeometry(distance, np.full(count, LOS), heights, heights, np.full(count, -np.inf), nothing)
        open_loss = self.path_loss.loss(between, self.frequency_ghz, np.full(count, 0.5))
        return self.background.table(), np.maximum.accumulate(open_loss)
