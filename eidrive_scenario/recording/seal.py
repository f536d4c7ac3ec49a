"""Seal of a recording: a digest over its whole content, written as the last metadata record.

Checksums of MCAP detect damaged bytes. The seal also detects replaced, missing and reordered content.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping

NAME = "end"
"""Name of the metadata record with the seal."""
_FRAME = struct.Struct("<IQQ")


class Seal:
    """SHA-256 over metadata, attachments and frames in write order."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self.frames = 0

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add the metadata of the run."""
        for text in (f"{len(metadata)}", *(text for entry in metadata.items() for text in entry)):
            self._add_text(text)

    def add_attachment(self, name: str, data: bytes) -> None:
        """Add an attached file."""
        self._add_text(name)
        self._sha.update(struct.pack("<Q", len(data)))
        self._sha.update(data)

    def add_frame(self, sequence: int, log_time: int, data: bytes) -> None:
        """Add a frame: its tick, its time [ns] and its JSON text."""
        self.frames += 1
        self._sha.update(_FRAME.pack(sequence, log_time, len(data)))
        self._sha.update(data)

    def entries(self) -> dict[str, str]:
        """Return the entries of the last metadata record of the recording."""
        return {"frames": str(self.frames), "sha256": self._sha.hexdigest()}

    def _add_text(self, text: str) -> None:
        data = text.encode()
        self._sha.update(struct.pack("<Q", len(data)))
        self._sha.update(data)
