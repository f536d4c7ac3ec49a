"""Resource pools of the sidelinks of C-V2X Mode 4 (LTE) and NR-V2X Mode 2, and settings of the resource selection."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field, model_validator

from eidrive_scenario.errors import suggestion
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.radio.nr_physical_layer import (
    BLOCKS,
    MAX_PROCESSING_SLOTS,
    MCS,
    SUBCARRIERS,
    control_elements,
    shared_elements,
    transport_block_bits,
)
from eidrive_scenario.v2x.radio.packet_error import CURVES, ErrorCurve, coded_curve
from eidrive_scenario.v2x.standards import CANDIDATE_SHARE, RESOURCE_BLOCKS, SUBFRAME

INTERVALS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Resource reservation intervals of Mode 4 [s]."""
PSCCH_BLOCKS = 2
"""Number of resource blocks of the control channel in the first subchannel (3GPP TS 36.213, 14.2)."""
MAX_SELECTION_WINDOW = 0.1
"""Maximum T2 [s] (3GPP TS 36.213, 14.1.1.6)."""


class ResourcePool(Settings):
    """Settings that the resource pools of Mode 4 and Mode 2 have in common.

    interval      resource reservation interval [s]
    resource_keep_probability   probability of keeping the resource when the reselection counter reaches 0
                  (probResourceKeep)
    processing    time from the message to the earliest slot that can carry it [s]; T1 of the selection window
    selection_window   T2, the end of the selection window, after the request [s]; None: the interval, at most 100 ms
    latency       latency requirement [s]: if the next reserved resource is later than this after the message could be
                  sent, the station selects a new one
    reselect_after     number of consecutive unused resources after which a station selects a new one
                  (sl-ReselectAfter); None: no such limit
    pssch_rsrp_threshold_dbm   SL-ThresPSSCH-RSRP, above which a decoded reservation excludes resources; it is raised by
                  3 dB while less than the share of candidates remains [dBm per resource element]
    cbr_threshold_dbm  S-RSSI above which a subchannel counts as busy [dBm] (ETSI TS 103 574, 5.2)
    """

    interval: float = 0.1
    resource_keep_probability: Annotated[float, Field(ge=0.0, le=0.8)] = 0.0
    processing: Annotated[float, Field(ge=0.0, le=0.004)] = 0.001
    selection_window: Annotated[float, Field(ge=0.02, le=MAX_SELECTION_WINDOW)] | None = None
    latency: Annotated[float, Field(gt=0.0)] = 0.1
    reselect_after: Annotated[int, Field(ge=1, le=9)] | None = None
    pssch_rsrp_threshold_dbm: Annotated[float, Field(ge=-128.0, le=-2.0)] = -128.0
    cbr_threshold_dbm: Annotated[float, Field(ge=-112.0, le=-22.0)] = -94.0

    @property
    def window(self) -> float:
        """T2 [s]."""
        return min(self.interval, MAX_SELECTION_WINDOW) if self.selection_window is None else self.selection_window

    @property
    def counter_range(self) -> tuple[int, int]:
        """Minimum and maximum reselection counter (3GPP TS 36.321, 5.14.1.1, and TS 38.321, 5.22.1.1)."""
        factor = math.ceil(0.1 / max(0.02, self.interval) - 1e-9)
        return 5 * factor, 15 * factor


class SidelinkSettings(ResourcePool):
    """Settings of the resource pool of C-V2X Mode 4 (10 MHz) and of the resource selection.

    subchannels        number of subchannels in 10 MHz
    subchannel_bytes   capacity of one subchannel in a subframe of 1 ms [bytes]
    pscch_errors       name of the packet error curve of the control channel
    """

    slot: ClassVar[float] = SUBFRAME
    sensing_window: ClassVar[float] = 1.0
    """Time for which a station remembers reservations [s] (3GPP TS 36.213, 14.1.1.6)."""
    noise_blocks: ClassVar[float] = RESOURCE_BLOCKS
    """Number of resource blocks with the noise of 10 MHz."""
    control_boost: ClassVar[float] = 2.0
    """Power ratio of resource elements of the control channel and of the data: 3 dB (3GPP TS 36.213, 14.2)."""
    candidate_share: ClassVar[float] = CANDIDATE_SHARE
    ranks_candidates: ClassVar[bool] = True
    """Whether only the candidates with the lowest average S-RSSI are reported."""
    periodic: ClassVar[bool] = True
    transmissions: ClassVar[int] = 1

    subchannels: Annotated[int, Field(ge=1, le=20)] = 4
    subchannel_bytes: Annotated[int, Field(ge=1)] = 190
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
    def noise_subchannels(self) -> float:
        """Number of subchannels with the noise of 10 MHz."""
        return self.subchannels

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


class NrSidelinkSettings(ResourcePool):
    """Settings of the resource pool of NR-V2X Mode 2 and of the resource selection (3GPP TS 38.214, 8.1).

    bandwidth_mhz, subcarrier_spacing_khz   carrier; a slot lasts 15 kHz / subcarrier spacing milliseconds
    subchannel_blocks    number of resource blocks of a subchannel
    mcs                  index of modulation and code rate (TS 38.214, table 5.1.3.1-1)
    dmrs_symbols         number of symbols with reference signals of the data
    pscch_symbols, pscch_blocks   symbols and resource blocks of the control channel in the first subchannel
    sensing_window       sl-SensingWindow [s]
    candidate_share      minimum share of candidate resources after exclusion (sl-TxPercentage)
    periodic             False: each message selects a new resource, and reserves none for the next message
    transmissions        number of transmissions of a message, within 32 slots, without feedback
    """

    control_boost: ClassVar[float] = 1.0
    ranks_candidates: ClassVar[bool] = False

    interval: Annotated[float, Field(ge=0.001, le=1.0)] = 0.1
    selection_window: Annotated[float, Field(ge=0.001, le=MAX_SELECTION_WINDOW)] | None = None
    bandwidth_mhz: Literal[10, 20, 30, 40] = 10
    subcarrier_spacing_khz: Literal[15, 30, 60] = 15
    subchannel_blocks: Literal[10, 12, 15, 20, 25, 50, 75, 100] = 10
    mcs: Annotated[int, Field(ge=0, lt=len(MCS))] = 11
    dmrs_symbols: Literal[2, 3, 4] = 4
    pscch_symbols: Literal[2, 3] = 3
    pscch_blocks: Literal[10, 12, 15, 20, 25] = 10
    sensing_window: float = 1.1
    candidate_share: float = CANDIDATE_SHARE
    periodic: bool = True
    transmissions: Annotated[int, Field(ge=1, le=3)] = 1

    @model_validator(mode="after")
    def _standard(self) -> NrSidelinkSettings:
        milliseconds = round(1000.0 * self.interval)
        whole = abs(1000.0 * self.interval - milliseconds) < 1e-6
        if not (whole and (1 <= milliseconds < 100 or milliseconds in range(100, 1001, 100))):
            raise ValueError(
                f"interval is not supported (got {self.interval:g} s; "
                "expected 1 to 99 ms, or a multiple of 100 ms up to 1 s)"
            )
        for name, value, choices in (
            ("sensing_window", self.sensing_window, (0.1, 1.1)),
            ("candidate_share", self.candidate_share, (0.2, 0.35, 0.5)),
        ):
            if value not in choices:
                raise ValueError(f"{name} is not supported (got {value:g}; expected one of {choices})")
        limit = MAX_PROCESSING_SLOTS[self.subcarrier_spacing_khz] * self.slot
        if self.processing > limit:
            raise ValueError(f"processing is above T_proc,1 (got {self.processing:g} s; at most {limit:g} s)")
        if self.subchannels < 1:
            raise ValueError(
                f"subchannel_blocks is more than the carrier has (got {self.subchannel_blocks}; "
                f"at most {self._carrier_blocks} in {self.bandwidth_mhz} MHz at {self.subcarrier_spacing_khz} kHz)"
            )
        if self.pscch_blocks > self.subchannel_blocks:
            raise ValueError(f"pscch_blocks is more than subchannel_blocks (got {self.pscch_blocks})")
        return self

    @property
    def slot(self) -> float:
        """Duration of a slot [s]."""
        return SUBFRAME * 15.0 / self.subcarrier_spacing_khz

    @property
    def subchannels(self) -> int:
        """Number of subchannels of the carrier, at most 27 (TS 38.331, sl-NumSubchannel)."""
        return min(27, self._carrier_blocks // self.subchannel_blocks)

    @property
    def noise_blocks(self) -> float:
        """Number of resource blocks with the noise of 10 MHz."""
        return 10e6 / (SUBCARRIERS * 1e3 * self.subcarrier_spacing_khz)

    @property
    def noise_subchannels(self) -> float:
        """Number of subchannels with the noise of 10 MHz."""
        return self.noise_blocks / self.subchannel_blocks

    @cached_property
    def control_curve(self) -> ErrorCurve:
        """Packet error curve of the first-stage SCI."""
        bits, elements = control_elements(self.pscch_symbols, self.pscch_blocks)
        return coded_curve(bits, elements, 2, None)

    @cached_property
    def data_curve(self) -> ErrorCurve:
        """Packet error curve of the data in one subchannel."""
        bits = 8 * self._capacities[0]
        return coded_curve(bits + (24 if bits > 3824 else 16), self._elements(1), MCS[self.mcs][0], bits // 8)

    def extent(self, size: int) -> tuple[int, int]:
        """Return the numbers of subchannels and of slots that a message of `size` bytes occupies."""
        for width, capacity in enumerate(self._capacities, start=1):
            if size <= capacity:
                return width, 1
        return self.subchannels, math.ceil(size / self._capacities[-1])

    def pssch_blocks(self, width: int) -> int:
        """Return the number of resource blocks of a transmission in `width` subchannels."""
        return self.subchannel_blocks * width

    @property
    def _carrier_blocks(self) -> int:
        return BLOCKS[self.subcarrier_spacing_khz][self.bandwidth_mhz // 10 - 1]

    def _elements(self, width: int) -> int:
        return shared_elements(
            self.pssch_blocks(width), self.mcs, self.dmrs_symbols, self.pscch_symbols, self.pscch_blocks
        )

    @cached_property
    def _capacities(self) -> tuple[int, ...]:
        """Bytes of a transport block in 1, 2, … subchannels."""
        return tuple(
            transport_block_bits(self._elements(width), self.mcs) // 8 for width in range(1, self.subchannels + 1)
        )


Pool: TypeAlias = SidelinkSettings | NrSidelinkSettings
