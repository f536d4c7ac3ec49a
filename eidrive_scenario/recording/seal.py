"""The seal of a recording: a digest over everything that it shows, written as its last metadata record.

Checksums of MCAP find damaged bytes; the seal also finds what was replaced, left out or put in another order.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping

NAME = "end"
"""Name of the metadata record with the seal."""
_FRAME = struct.Struct("<IQQ")


class Seal:
    """SHA-256 over metadata, attachments and frames, in the order in which they were written."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self.frames = 0

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Take the metadata of the run in."""
        for text in (f"{len(metadata)}", *(text for entry in metadata.items() for text in entry)):
            self._add_text(text)

    def add_attachment(self, name: str, data: bytes) -> None:
        """Take an attached file in."""
        self._add_text(name)
        self._sha.update(struct.pack("<Q", len(data)))
        self._sha.update(data)

    def add_frame(self, sequence: int, log_time: int, data: bytes) -> None:
        """Take a frame in: its tick, its time [ns] and its text."""
        self.frames += 1
        self._sha.update(_FRAME.pack(sequence, log_time, len(data)))
        self._sha.update(data)

    def entries(self) -> dict[str, str]:
        """The metadata record that closes the recording."""
        return {"frames": str(self.frames), "sha256": self._sha.hexdigest()}

    def _add_text(self, text: str) -> None:
        data = text.encode()
        self._sha.update(struct.pack("<Q", len(data)))
        self._sha.update(data)
