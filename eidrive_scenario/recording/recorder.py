"""Recorder of a run as an MCAP file: all frames without loss, and all inputs for replay and evaluation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from eidrive_scenario.base.content_digest import package_versions
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.files.atomic import create
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.integrity import NAME as SEAL
from eidrive_scenario.recording.integrity import Seal
from eidrive_scenario.recording.json_text import JsonText

if TYPE_CHECKING:
    from mcap.writer import Writer

TOPIC = "/frame"
FORMAT = "4"
"""Version of the recording format, stored in the metadata."""
READABLE = ("2", "3", FORMAT)
"""Versions that are read. Version 3 lacks the expired messages of stations, version 2 also the commands of frames and
the outcome of the run."""
CHUNK_SIZE = 256 * 2**10
"""Uncompressed size at which a chunk is written [bytes]."""
_SPAN = 1_000_000_000
"""Simulated time after which a chunk of any size is written [ns]."""
RUN = "run"
"""Name of the metadata record that describes the run."""
TRACE_METADATA = "net.asam.osi.trace"
"""Name of the metadata record of a recording that is an OSI trace, too."""
FRAMES = 1
"""Number of the channel of `/frame`; topics for other tools have other channels."""


class Recorder:
    """Observer that writes an MCAP file: JSON messages with a JSON schema on `/frame`, compressed with Zstandard.

    metadata     scenario, seed and settings of the run; package versions are added
    attachments  attached files by name, for example the scenario and its road file

    A chunk is written after every second of simulated time or 256 KiB. A killed process loses at most one chunk.

    Timestamps are simulated times, so equal runs give equal files. Raise SettingError if the file cannot be written.
    """

    def __init__(
        self, path: str | Path, *, metadata: Mapping[str, str], attachments: Mapping[str, bytes] | None = None
    ) -> None:
        from mcap.writer import CompressionType, Writer

        self._file = create(path)
        self._seal = Seal()
        zstd = CompressionType.ZSTD
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=zstd, enable_data_crcs=True)
        self._writer.start(profile="", library="eidrive-scenario")
        entries = {"format": FORMAT, **package_versions(), **metadata}
        self._writer.add_metadata(RUN, entries)
        self._seal.add_metadata(entries)
        for name, data in (attachments or {}).items():
            self.attach(name, data)
        self._due = 0
        self._text = JsonText(Frame)
        schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Frame", **codec(Frame).schema}
        schema_id = self._writer.register_schema("eidrive.Frame", "jsonschema", json.dumps(schema).encode())
        channel = self._writer.register_channel(TOPIC, "json", schema_id)
        assert channel == FRAMES, "the first channel of a file has the number 1"

    @property
    def writer(self) -> Writer:
        """Writer of the file, for topics beside `/frame`."""
        return self._writer

    def attach(self, name: str, data: bytes) -> None:
        """Append an attached file. Raise SimulationError if the recording is closed."""
        self.check_open()
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._writer.add_attachment(0, 0, name, "application/octet-stream", data)
        self._seal.add_attachment(name, data)

    def observe(self, frame: Frame) -> None:
        """Append one frame. Raise SimulationError if the file is closed: each run needs its own recorder."""
        self.check_open()
        self.write(frame)

    def write(self, frame: Frame) -> int:
        """Append one frame to the open file, and return the size of its text [bytes]."""
        data, instant = self._text.encode(frame), _nanoseconds(frame)
        self._writer.add_message(FRAMES, instant, data, instant, sequence=frame.view.tick)
        self._seal.add_frame(frame.view.tick, instant, data)
        if self.is_due(frame):
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._due = instant + _SPAN
        return len(data)

    def is_due(self, frame: Frame) -> bool:
        """Return whether the chunk ends with this frame, whatever its size."""
        return _nanoseconds(frame) >= self._due

    def check_open(self) -> None:
        """Raise SimulationError if the recording is closed."""
        if self._file.closed:
            raise SimulationError(f"{self._file.name}: the recording is closed; a second run needs a second Recorder")

    def close(self, *, sealed: bool = True) -> None:
        """Finish the file. A second call has no effect.

        sealed  False: without the seal, as for a run that did not end
        """
        if self._file.closed:
            return
        with self._file:
            self._writer.flush()  # type: ignore[no-untyped-call]
            if sealed:
                self._writer.add_metadata(SEAL, self._seal.entries())
            self._writer.finish()  # type: ignore[no-untyped-call]


def _nanoseconds(frame: Frame) -> int:
    return round(frame.view.time * 1e9)
