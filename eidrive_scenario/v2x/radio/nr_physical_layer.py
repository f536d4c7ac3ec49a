"""Physical layer of the NR sidelink: resource elements and size of a transport block in a slot.

Sources: 3GPP TS 38.211, 8.3; TS 38.212, 8.4.4; TS 38.214, 5.1.3 and 8.1.3.2; TS 38.101-1, table 5.3.2-1.
"""

from __future__ import annotations

import math
from bisect import bisect_left

SUBCARRIERS = 12
"""Number of subcarriers of one resource block."""
BLOCKS = {15: (52, 106, 160, 216), 30: (24, 51, 78, 106), 60: (11, 24, 38, 51)}
"""Number of resource blocks in 10, 20, 30 and 40 MHz, by subcarrier spacing [kHz]."""
MAX_PROCESSING_SLOTS = {15: 3, 30: 5, 60: 9}
"""T_proc,1 in slots, by subcarrier spacing [kHz] (TS 38.214, table 8.1.4-2)."""
MCS = (
    *((2, rate) for rate in (120, 157, 193, 251, 308, 379, 449, 526, 602, 679)),
    *((4, rate) for rate in (340, 378, 434, 490, 553, 616, 658)),
    *((6, rate) for rate in (438, 466, 517, 567, 616, 666, 719, 772, 822, 873, 910, 948)),
)
"""Modulation order and code rate times 1024, by index (TS 38.214, table 5.1.3.1-1)."""

_SHARED_SYMBOLS = 12
"""PSSCH symbols of a slot without the first, which is repeated for gain control, and the last, the guard."""
_DMRS_PER_SYMBOL = 6
"""Resource elements with reference signals in one DMRS symbol of one resource block of the PSSCH."""
_PSCCH_DATA = 9
"""Resource elements without reference signals in one symbol of one resource block of the PSCCH."""
_SCI_1_BITS, _SCI_2_BITS, _SCI_CRC = 40, 35, 24
"""Information bits of SCI format 1-A, a typical number that depends on the pool, and 2-A, and their CRC."""
_BETA_OFFSET, _SCALING = 1.125, 0.5
"""beta_offset and alpha of the second-stage SCI, the least of each (TS 38.331, sl-BetaOffsets2ndSCI, sl-Scaling)."""
_SMALL_BLOCKS = (
    *range(24, 193, 8), *range(208, 385, 16), *range(408, 481, 24), *range(504, 577, 24), *range(608, 769, 32),
    808, 848, 888, 928, 984, 1032, 1064, *range(1128, 1353, 32), *range(1416, 1929, 64), *range(2024, 2281, 64),
    *range(2408, 2857, 64), 2976, 3104, 3240, 3368, 3496, 3624, 3752, 3824,
)  # fmt: skip
"""Transport block sizes up to 3824 bits (TS 38.214, table 5.1.3.2-1)."""


def control_elements(pscch_symbols: int, pscch_blocks: int) -> tuple[int, int]:
    """Return the bits of the first-stage SCI with CRC, and the resource elements of the PSCCH that carry them."""
    return _SCI_1_BITS + _SCI_CRC, pscch_symbols * pscch_blocks * _PSCCH_DATA


def shared_elements(blocks: int, mcs: int, dmrs_symbols: int, pscch_symbols: int, pscch_blocks: int) -> int:
    """Return the resource elements for data in a slot of `blocks` resource blocks (TS 38.214, 8.1.3.2)."""
    elements = blocks * (SUBCARRIERS * _SHARED_SYMBOLS - _DMRS_PER_SYMBOL * dmrs_symbols)
    elements -= SUBCARRIERS * pscch_symbols * pscch_blocks
    second_stage = (_SCI_2_BITS + _SCI_CRC) * _BETA_OFFSET / (2.0 * MCS[mcs][1] / 1024.0)  # always QPSK
    return elements - min(math.ceil(second_stage), math.ceil(_SCALING * elements))


def transport_block_bits(elements: int, mcs: int) -> int:
    """Return the size of the transport block in these resource elements [bits] (TS 38.214, 5.1.3.2)."""
    order, rate = MCS[mcs][0], MCS[mcs][1] / 1024.0
    information = elements * order * rate
    if information <= 3824:
        step = int(2 ** max(3, math.floor(math.log2(information)) - 6))
        quantized = max(24, step * math.floor(information / step))
        return int(_SMALL_BLOCKS[bisect_left(_SMALL_BLOCKS, quantized)])
    step = int(2 ** (math.floor(math.log2(information - 24)) - 5))
    quantized = max(3840, step * math.floor((information - 24) / step + 0.5)) + 24
    parts = math.ceil(quantized / 3816) if rate <= 0.25 else math.ceil(quantized / 8424) if quantized > 8448 else 1
    return 8 * parts * math.ceil(quantized / (8 * parts)) - 24
