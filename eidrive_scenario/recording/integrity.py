"""Integrity of a recording: its seal, and the report of its damage.

Checksums of MCAP detect damaged bytes. The seal, a digest over the whole content in the last metadata record, also
detects replaced, missing and reordered content.
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
            self._add(text.encode())

    def add_attachment(self, name: str, data: bytes) -> None:
        """Add an attached file."""
        self._add(name.encode())
        self._add(data)

    def add_frame(self, sequence: int, log_time: int, data: bytes) -> None:
        """Add a frame: its tick, its time [ns] and its JSON text."""
        self.frames += 1
        self._sha.update(_FRAME.pack(sequence, log_time, len(data)))
        self._sha.update(data)

    def entries(self) -> dict[str, str]:
        """Return the entries of the last metadata record of the recording."""
        return {"frames": str(self.frames), "sha256": self._sha.hexdigest()}

    def _add(self, data: bytes) -> None:
        self._sha.update(struct.pack("<Q", len(data)))
        self._sha.update(data)


_SHOWN = 3
"""Number of locations that are listed for each kind of damage."""
_MAX_KINDS = 50
"""Maximum number of kinds of damage that are listed separately."""


class DamageReport:
    """Collector of damage that is found while a file is read. Its size does not grow with the damage."""

    def __init__(self) -> None:
        self._locations: dict[str, list[str]] = {}
        self._counts: dict[str, int] = {}

    def add(self, kind: str, location: str = "") -> None:
        """Add one case of damage of this kind, with its location in the file."""
        if kind not in self._counts and len(self._counts) >= _MAX_KINDS:
            kind = "further damage"
        self._counts[kind] = self._counts.get(kind, 0) + 1
        locations = self._locations.setdefault(kind, [])
        if location and len(locations) < _SHOWN:
            locations.append(location)

    def __bool__(self) -> bool:
        return bool(self._counts)

    def lines(self) -> tuple[str, ...]:
        """Return one line for each kind of damage."""
        return tuple(self._line(kind, count) for kind, count in self._counts.items())

    def _line(self, kind: str, count: int) -> str:
        locations = self._locations[kind]
        more = f" and {count - len(locations)} more" if locations and count > len(locations) else ""
        return f"{kind}: {', '.join(locations)}{more}" if locations else kind
