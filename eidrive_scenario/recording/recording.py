"""Reader of recordings: frames without loss, and detection of damage."""

from __future__ import annotations

import logging
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded import check_values, path_argument
from eidrive_scenario.recording import mcap_records as mcap
from eidrive_scenario.recording.frame import Frame, check_frame
from eidrive_scenario.recording.integrity import NAME as SEAL
from eidrive_scenario.recording.integrity import DamageReport, Seal
from eidrive_scenario.recording.json_text import JsonText
from eidrive_scenario.recording.recorder import FORMAT, FRAMES, READABLE, RUN, TRACE_METADATA
from eidrive_scenario.recording.run_files import recording_in

MAX_FRAMES = 1_000_000
"""Maximum number of frames that are read."""
LARGEST_FRAME = 64 * 2**20
"""Maximum size of a frame [bytes]."""
_MAX_VALUES = 4_000_000
"""Maximum number of values in a frame."""
_LARGEST_ATTACHMENTS = 320 * 2**20
"""Maximum total size of all attachments [bytes]."""
_LARGEST_METADATA = 32 * 2**20
"""Maximum size of a metadata record [bytes]."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recording:
    """Recorded run with lazy access: each call of `frames` reads the file.

    frame_count  number of frames in the file
    damage       differences from the file as it was written, one line for each kind; empty for an undamaged file, whose
                 frames equal the recorded ones bit for bit
    """

    path: Path
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]
    frame_count: int = 0
    damage: tuple[str, ...] = ()
    _blocks: tuple[int, ...] = field(default=(), repr=False)
    """Offsets of the records with frames, in the order of their first frames."""

    @property
    def scenario(self) -> str:
        """Name of the scenario in the library, or of its file; empty if the metadata omit it."""
        return self.metadata.get("scenario", "")

    @property
    def seed(self) -> int:
        """Seed of the run; 0 if the metadata of a damaged file omit it."""
        try:
            return int(self.metadata.get("seed", "0"))
        except ValueError:
            return 0

    def frames(self, skipped: Callable[[str], None] | None = None) -> Iterator[Frame]:
        """Yield the frames in order, bit for bit equal to the recorded ones if the recording is undamaged.

        Unreadable frames of a damaged recording are skipped, and `skipped` is called with the reason for each.
        Raise InputError if this version cannot read a frame of an undamaged recording, or if the file has changed since
        it was opened.
        """
        decode = JsonText(Frame).decode
        last = -1
        damage = DamageReport()
        with mcap.McapFile(self.path, damage) as file:
            for offset in self._blocks:
                for message in self._messages_again(file, offset, damage):
                    if message.sequence <= last:
                        continue  # duplicate
                    try:
                        frame = _decode_frame(message.data, decode)
                    except ValueError as error:
                        self._skip(message.sequence, error, skipped)
                        continue
                    last = message.sequence
                    yield frame

    def _messages_again(self, file: mcap.McapFile, offset: int, damage: DamageReport) -> list[mcap.Message]:
        """Return the frames of a record that had some when the file was opened. Raise InputError if it has changed."""
        try:
            messages = _messages(file, file.record_at(offset), damage)
        except (struct.error, mcap.ContentLimitError):
            messages = []
        if not messages or (damage and not self.damage):
            raise InputError(Diagnostic("the file has changed since it was opened", "open it again", str(self.path)))
        return messages

    def _skip(self, tick: int, error: ValueError, skipped: Callable[[str], None] | None) -> None:
        reason = f"frame {tick} cannot be decoded: {error}"
        if not self.damage:
            version = self.metadata.get("eidrive-scenario", "unknown")
            hint = f"record the run again, or read it with the version that wrote it ({version})"
            raise InputError(Diagnostic(reason, hint, str(self.path))) from error
        if skipped is not None:
            skipped(reason)


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording, given as its file, the folder of its run, or a folder that contains a single run.

    The whole file is checked. If it is damaged, `damage` of the recording describes it, and a warning is logged.
    Raise InputError if the file does not exist or is not a recording of this package.
    """
    recording = open_recording(recording_in(path_argument(path, "path")))
    if recording.damage:
        _log.warning("%s is damaged: %s", recording.path, "; ".join(recording.damage))
    return recording


def open_recording(path: Path) -> Recording:
    """Open a recording as `read_recording` does, given as its file and without the warning."""
    damage = DamageReport()
    with mcap.McapFile(path, damage) as file:
        reading = _Reading(file, damage)
        for record in file.records():
            reading.add(record)
            if reading.is_full:
                break
    return reading.finish(path)


class _Reading:
    """State of one pass over a file: content and damage."""

    def __init__(self, file: mcap.McapFile, damage: DamageReport) -> None:
        self.damage = damage
        self._file = file
        self._metadata: dict[str, str] = {}
        self._attachments: dict[str, bytes] = {}
        self._blocks: list[tuple[int, int]] = []
        self._seal = Seal()
        self._stored: dict[str, str] | None = None
        self._ticks = _Ticks(self.damage)
        self._stated: int | None = None
        self.is_full = False

    def add(self, record: mcap.Record) -> None:
        """Process a record. An unreadable record is reported as damage."""
        try:
            if record.opcode == mcap.METADATA:
                self._add_metadata(record)
            elif record.opcode == mcap.ATTACHMENT:
                self._add_attachment(record)
            elif record.opcode in (mcap.CHUNK, mcap.MESSAGE):
                self._add_frames(record)
            elif record.opcode == mcap.STATISTICS:
                self._stated = mcap.message_count(record.body, FRAMES)
        except (ValueError, struct.error):
            self.damage.add("a record cannot be read", f"byte {record.offset}")

    def _add_metadata(self, record: mcap.Record) -> None:
        if len(record.body) > _LARGEST_METADATA:
            raise ValueError(f"metadata record is too large (got {len(record.body)} bytes)")
        name, entries = mcap.metadata_of(record.body)
        if name == RUN and not self._metadata:
            self._metadata = entries
            self._seal.add_metadata(entries)
        elif name == SEAL and self._stored is None:
            self._stored = entries
        elif name != TRACE_METADATA:
            self.damage.add("a metadata record is duplicated or unknown", f"byte {record.offset}")

    def _add_attachment(self, record: mcap.Record) -> None:
        name, data, intact = mcap.attachment_of(record.body)
        if name in self._attachments:
            self.damage.add("an attachment is duplicated", repr(name[:80]))
            return
        if len(data) + sum(map(len, self._attachments.values())) > _LARGEST_ATTACHMENTS:
            self.damage.add(f"the attachments are larger than {_LARGEST_ATTACHMENTS // 2**20} MiB")
            return
        if not intact:
            self.damage.add("an attachment does not match its checksum", repr(name[:80]))
        self._attachments[name] = data
        self._seal.add_attachment(name, data)

    def _add_frames(self, record: mcap.Record) -> None:
        try:
            messages = _messages(self._file, record, self.damage)
        except mcap.ContentLimitError:
            messages, self.is_full = [], True
        if self.is_full or self._seal.frames + len(messages) > MAX_FRAMES:
            self.damage.add("the recording exceeds the maximum number or size of frames and messages")
            self.is_full = True
            return
        for message in messages:
            self._ticks.add(message.sequence)
            self._seal.add_frame(message.sequence, message.log_time, message.data)
        if messages:
            self._blocks.append((messages[0].sequence, record.offset))

    def finish(self, path: Path) -> Recording:
        """Return the recording. Raise InputError if package or format differ."""
        recorded_format = self._metadata.get("format")
        if recorded_format not in READABLE and (recorded_format is not None or not self._seal.frames):
            got = "no format" if recorded_format is None else f"format {recorded_format[:20]!r}"
            message = f"not a recording of this version of eidrive (got {got}; expected format {FORMAT!r})"
            raise InputError(Diagnostic(message, "give a recording that this version wrote", str(path)))
        self._check_seal()
        return Recording(
            path,
            self._metadata,
            self._attachments,
            self._seal.frames,
            self.damage.lines(),
            tuple(offset for _, offset in sorted(self._blocks)),
        )

    def _check_seal(self) -> None:
        frames = self._seal.frames
        self._ticks.finish()
        if not self._metadata:
            self.damage.add("the metadata of the run are missing")
        if self._stored is None and self._stated not in (None, frames):
            self.damage.add(f"{frames} of {self._stated} recorded frames are present")
        if self._stored is None:
            self.damage.add("the seal at the end is missing: the run did not end, or the file was truncated")
        elif self._stored.get("frames") != str(frames):
            self.damage.add(f"{frames} of {self._stored.get('frames', '')[:20]} recorded frames are present")
        elif self._stored != self._seal.entries():
            self.damage.add("frames, settings or attachments differ from the recorded ones")


class _Ticks:
    """Check of order and gaps of the ticks."""

    def __init__(self, damage: DamageReport) -> None:
        self._damage = damage
        self._last: int | None = None
        self._ordered = True
        self._gaps: list[str] = []

    def add(self, tick: int) -> None:
        if self._last is not None and tick <= self._last:
            self._ordered = False
            self._damage.add("frames are duplicated or out of order", f"tick {tick} after {self._last}")
        elif self._last is not None and tick > self._last + 1 and len(self._gaps) < 1000:
            first, last = self._last + 1, tick - 1
            self._gaps.append(f"{first}" if first == last else f"{first} to {last}")
        self._last = tick

    def finish(self) -> None:
        """Report gaps only beside other damage: an undamaged recording may hold every second frame."""
        if self._damage and self._ordered:
            for gap in self._gaps:
                self._damage.add("ticks are missing", gap)


def _messages(file: mcap.McapFile, record: mcap.Record, damage: DamageReport) -> list[mcap.Message]:
    """Return the frames of a record without frames beyond the maximum size, and without messages of other topics."""
    frames = file.messages(record, FRAMES)
    kept = [message for message in frames if len(message.data) <= LARGEST_FRAME]
    if len(kept) < len(frames):
        damage.add(f"a frame is larger than {LARGEST_FRAME // 2**20} MiB", f"byte {record.offset}")
    return kept


def _decode_frame(data: bytes, decode: Callable[[bytes], Frame]) -> Frame:
    """Decode a frame. Raise ValueError for every kind of invalid content."""
    try:
        check_values(data, _MAX_VALUES)
        frame = decode(data)
        frame = replace(frame, links=tuple(frame.links))  # msgspec reads sequences as lists
        check_frame(frame)
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"{type(error).__name__}: {error}"[:200]) from None
    return frame
