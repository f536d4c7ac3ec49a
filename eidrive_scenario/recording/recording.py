"""Reading a recording: its frames without loss, and whether they are those that were recorded."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded_json import load_json
from eidrive_scenario.recording import mcap_records as mcap
from eidrive_scenario.recording.codec import codec
from eidrive_scenario.recording.damage import DamageReport
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.frame_check import check_frame
from eidrive_scenario.recording.recorder import FORMAT, RUN
from eidrive_scenario.recording.run_files import recording_in
from eidrive_scenario.recording.seal import NAME as SEAL
from eidrive_scenario.recording.seal import Seal

MOST_FRAMES = 1_000_000
"""Maximum number of frames that are read."""
LARGEST_FRAME = 64 * 2**20
"""Maximum size of a frame [bytes]."""
_MOST_VALUES = 4_000_000
"""Maximum number of values in a frame."""
_LARGEST_ATTACHMENTS = 320 * 2**20
"""Maximum size of all attachments together [bytes]."""
_LARGEST_METADATA = 32 * 2**20

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recording:
    """A recorded run, read lazily: its frames come from the file each time they are asked for.

    frame_count  number of frames that the file holds
    damage       what differs from the file as it was written, a line for each kind; empty for an undamaged file, whose
                 frames are those that were recorded, to the last bit
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
        """The name of the scenario, or an empty text where the file does not say."""
        return self.metadata.get("scenario", "")

    @property
    def seed(self) -> int:
        """The seed of the run; 0 where a damaged file does not say."""
        try:
            return int(self.metadata.get("seed", "0"))
        except ValueError:
            return 0

    def frames(self, skipped: Callable[[str], None] | None = None) -> Iterator[Frame]:
        """The frames in order, equal to those recorded to the last bit if the recording is undamaged.

        Of a damaged recording, frames that cannot be read are left out. `skipped` is called with the reason of each.
        Raises InputError if a frame of an undamaged recording cannot be read by this version.
        """
        decode = codec(Frame).decode
        last = -1
        with mcap.McapFile(self.path, DamageReport()) as file:
            for offset in self._blocks:
                for message in _messages(file.record_at(offset)):
                    if message.sequence <= last:
                        continue  # a second copy
                    try:
                        frame = _decoded(message.data, decode)
                    except ValueError as error:
                        self._skip(message.sequence, error, skipped)
                        continue
                    last = message.sequence
                    yield frame

    def _skip(self, tick: int, error: ValueError, skipped: Callable[[str], None] | None) -> None:
        reason = f"frame {tick} does not read: {error}"
        if not self.damage:
            hint = f"read it with the version that wrote it ({self.metadata.get('eidrive-scenario', 'unknown')})"
            raise InputError(Diagnostic(reason, hint, str(self.path))) from error
        if skipped is not None:
            skipped(reason)


def read_recording(path: str | Path) -> Recording:
    """Open a recording, given by its file or by the folder of its run, or one with a single run below.

    The whole file is checked. If it is damaged, `damage` of the recording describes it, and a warning is logged.
    Raises InputError if it is not there or not a recording of this package.
    """
    recording = open_recording(recording_in(Path(path)))
    if recording.damage:
        _log.warning("%s is damaged: %s", recording.path, "; ".join(recording.damage))
    return recording


def open_recording(path: Path) -> Recording:
    """As `read_recording`, of a file, without the warning."""
    reading = _Reading()
    with mcap.McapFile(path, reading.damage) as file:
        for record in file.records():
            reading.take(record)
            if reading.is_full:
                break
    return reading.finish(path)


class _Reading:
    """One pass over a file: what it holds, and whether that is what was written."""

    def __init__(self) -> None:
        self.damage = DamageReport()
        self._metadata: dict[str, str] = {}
        self._attachments: dict[str, bytes] = {}
        self._blocks: list[tuple[int, int]] = []
        self._seal = Seal()
        self._stored: dict[str, str] | None = None
        self._ticks = _Ticks(self.damage)
        self._content = 0
        self._stated: int | None = None
        self.is_full = False

    def take(self, record: mcap.Record) -> None:
        """Take a record in; one that cannot be read is damage."""
        try:
            self._take(record)
        except (ValueError, struct.error):
            self.damage.add("a record cannot be read", f"byte {record.offset}")

    def _take(self, record: mcap.Record) -> None:
        if record.opcode == mcap.METADATA:
            self._take_metadata(record)
        elif record.opcode == mcap.ATTACHMENT:
            self._take_attachment(record)
        elif record.opcode in (mcap.CHUNK, mcap.MESSAGE):
            self._take_frames(record)
        elif record.opcode == mcap.STATISTICS:
            self._stated = mcap.statistics_of(record.body)

    def _take_metadata(self, record: mcap.Record) -> None:
        if len(record.body) > _LARGEST_METADATA:
            raise ValueError("too large")
        name, entries = mcap.metadata_of(record.body)
        if name == RUN and not self._metadata:
            self._metadata = entries
            self._seal.add_metadata(entries)
        elif name == SEAL and self._stored is None:
            self._stored = entries
        else:
            self.damage.add("a metadata record is doubled or unknown", f"byte {record.offset}")

    def _take_attachment(self, record: mcap.Record) -> None:
        name, data, intact = mcap.attachment_of(record.body)
        if name in self._attachments:
            self.damage.add("an attachment is doubled", repr(name[:80]))
            return
        if len(data) + sum(map(len, self._attachments.values())) > _LARGEST_ATTACHMENTS:
            self.damage.add(f"the attachments are larger than {_LARGEST_ATTACHMENTS // 2**20} MiB")
            return
        if not intact:
            self.damage.add("an attachment does not match its checksum", repr(name[:80]))
        self._attachments[name] = data
        self._seal.add_attachment(name, data)

    def _take_frames(self, record: mcap.Record) -> None:
        messages = _messages(record, self.damage)
        self._content += sum(len(message.data) for message in messages)
        if self._content > mcap.LARGEST_CONTENT or self._seal.frames + len(messages) > MOST_FRAMES:
            self.damage.add("there are more frames than are read")
            self.is_full = True
            return
        for message in messages:
            self._ticks.add(message.sequence)
            self._seal.add_frame(message.sequence, message.log_time, message.data)
        if messages:
            self._blocks.append((messages[0].sequence, record.offset))

    def finish(self, path: Path) -> Recording:
        """The recording. Raises InputError if this is none of this package and layout."""
        found = self._metadata.get("format")
        if found != FORMAT and (found is not None or not self._seal.frames):
            what = "not a recording of eidrive" if found is None else f"a recording of layout {found[:20]!r}"
            raise InputError(Diagnostic(what, "give a recording that this version of eidrive wrote", str(path)))
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
            self.damage.add("the description of the run is missing")
        if self._stored is None and self._stated not in (None, frames):
            self.damage.add(f"{frames} of {self._stated} recorded frames are there")
        if self._stored is None:
            self.damage.add("the seal at the end is missing: the run did not end, or the file was cut short")
        elif self._stored.get("frames") != str(frames):
            self.damage.add(f"{frames} of {self._stored.get('frames', '')[:20]} recorded frames are there")
        elif self._stored != self._seal.entries():
            self.damage.add("frames, settings or attachments are not those that were recorded")


class _Ticks:
    """Order and gaps of the ticks."""

    def __init__(self, damage: DamageReport) -> None:
        self._damage = damage
        self._last: int | None = None
        self._ordered = True
        self._gaps: list[str] = []

    def add(self, tick: int) -> None:
        if self._last is not None and tick <= self._last:
            self._ordered = False
            self._damage.add("frames are doubled or out of order", f"tick {tick} after {self._last}")
        elif self._last is not None and tick > self._last + 1 and len(self._gaps) < 1000:
            first, last = self._last + 1, tick - 1
            self._gaps.append(f"{first}" if first == last else f"{first} to {last}")
        self._last = tick

    def finish(self) -> None:
        """Gaps count only where something else is wrong: a recorder may have been given every second frame."""
        if self._damage and self._ordered:
            for gap in self._gaps:
                self._damage.add("ticks are missing", gap)


def _messages(record: mcap.Record, damage: DamageReport | None = None) -> list[mcap.Message]:
    """The frames in a record, those that are larger than any frame left out."""
    damage = DamageReport() if damage is None else damage
    found = [mcap.message_of(record.body)] if record.opcode == mcap.MESSAGE else mcap.chunk_messages(record, damage)
    kept = [message for message in found if len(message.data) <= LARGEST_FRAME]
    if len(kept) < len(found):
        damage.add(f"a frame is larger than {LARGEST_FRAME // 2**20} MiB", f"byte {record.offset}")
    return kept


def _decoded(data: bytes, decode: Callable[[object], Frame]) -> Frame:
    """A frame. Raises ValueError whatever is wrong with its text."""
    try:
        frame = decode(load_json(data, _MOST_VALUES))
        check_frame(frame)
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"{type(error).__name__}: {error}"[:200]) from None
    return frame
