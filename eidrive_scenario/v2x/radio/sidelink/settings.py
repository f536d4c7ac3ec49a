"""Settings of the resource pool and of the resource selection of C-V2X Mode 4."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from eidrive_scenario.errors import suggestion
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.radio.packet_error import CURVES, ErrorCurve
from eidrive_scenario.v2x.standards import RESOURCE_BLOCKS, SUBFRAME

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
