"""A run as an MCAP file: every frame without loss, and all that is needed to show it or judge it again."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Attachment, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.output import create
from eidrive_scenario.recording.run_files import recording_in

TOPIC = "/frame"
FORMAT = "1"
"""Version of the recording's layout, in its metadata."""
_VERSIONS = ("eidrive-scenario", "numpy", "pybullet")


class Recorder:
    """Writes an MCAP file: JSON messages with a JSON schema on the topic `/frame`, compressed with Zstandard.

    metadata     what was run: scenario, seed, settings; versions of the packages are added
    attachments  files to carry along by name, say the scenario and its road

    Times in the file are simulated ones, so equal runs give equal files. Raises SettingError if the file cannot be
    written.
    """

    def __init__(
        self, path: str | Path, *, metadata: Mapping[str, str], attachments: Mapping[str, bytes] | None = None
    ) -> None:
        self._file = create(path)
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="eidrive-scenario")
        self._writer.add_metadata("run", {"format": FORMAT, **_versions(), **metadata})
        for name, data in (attachments or {}).items():
            self._writer.add_attachment(0, 0, name, "application/octet-stream", data)
        self._codec = codec(Frame)
        schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Frame", **self._codec.schema}
        schema_id = self._writer.register_schema("eidrive.Frame", "jsonschema", json.dumps(schema).encode())
        self._channel = self._writer.register_channel(TOPIC, "json", schema_id)

    def observe(self, frame: Frame) -> None:
        """Append one frame."""
        data = json.dumps(self._codec.encode(frame), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        instant = round(frame.view.time * 1e9)
        self._writer.add_message(self._channel, instant, data.encode(), instant, sequence=frame.view.tick)

    def close(self) -> None:
        """Finish the file; a second call does nothing."""
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()


@dataclass(frozen=True)
class Recording:
    """A recorded run, read lazily: its frames come from the file each time they are asked for."""

    path: Path
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]

    @property
    def scenario(self) -> str:
        """The name of the scenario, or an empty text where the file does not say."""
        return self.metadata.get("scenario", "")

    @property
    def seed(self) -> int:
        """The seed of the run."""
        return int(self.metadata.get("seed", "0"))

    def frames(self) -> Iterator[Frame]:
        """The frames in order, equal to those recorded to the last bit.

        A file that was cut short, as its run was killed, gives the frames that it holds. Raises InputError where the
        content is not a frame of this version.
        """
        decode = codec(Frame).decode
        for record in _records(self.path):
            if isinstance(record, Message):
                try:
                    yield decode(json.loads(record.data))
                except (KeyError, TypeError, ValueError) as error:
                    problem = Problem(
                        f"frame {record.sequence} does not read: {error!r}",
                        f"read it with the version that wrote it ({self.metadata.get('eidrive-scenario', 'unknown')})",
                        str(self.path),
                    )
                    raise InputError(problem) from error

    @cached_property
    def frame_count(self) -> int:
        """How many frames the file holds."""
        return sum(isinstance(record, Message) for record in _records(self.path))


def read_recording(path: str | Path) -> Recording:
    """Open a recording, given by its file or by the folder of its run, or one with a single run below.

    Raises InputError if it is not there or not a recording of this package.
    """
    path = recording_in(Path(path))
    metadata: dict[str, str] = {}
    attachments: dict[str, bytes] = {}
    for record in _records(path):
        if isinstance(record, Metadata) and record.name == "run":
            metadata = record.metadata
        elif isinstance(record, Attachment):
            attachments[record.name] = record.data
        elif isinstance(record, Message):
            break
    if metadata.get("format") != FORMAT:
        found = f"a recording of layout {metadata['format']}" if "format" in metadata else "not a recording of eidrive"
        raise InputError(Problem(f"{found}", "give a recording that this version of eidrive wrote", str(path)))
    return Recording(path, metadata, attachments)


def _records(path: Path) -> Iterator[Any]:
    try:
        with path.open("rb") as stream:
            yield from StreamReader(stream).records
    except (EndOfFile, struct.error, ZstdError):
        return  # cut short in the middle of a record
    except OSError as error:
        raise InputError(Problem(f"cannot read: {error.strerror}", "give an MCAP recording", str(path))) from error
    except McapError as error:
        raise InputError(Problem(f"not an MCAP file: {error}", "give an MCAP recording", str(path))) from error


def _versions() -> dict[str, str]:
    found = {}
    for name in _VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
