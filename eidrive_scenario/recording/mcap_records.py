"""Reader of MCAP records from untrusted sources: bounded in size, checked, with resynchronization after damage.

The layout follows the MCAP specification, version 0 (https://mcap.dev/spec).
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Self

import zstandard

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.files.similar_paths import file_suggestion
from eidrive_scenario.recording.integrity import DamageReport

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, STATISTICS, METADATA, DATA_END = 2, 3, 4, 5, 6, 9, 11, 12, 15
LARGEST_RECORD = 320 * 2**20
"""Maximum size of a record [bytes]. An attached road file may have 256 MiB."""
LARGEST_CHUNK = 128 * 2**20
"""Maximum uncompressed size of a chunk [bytes]. The recorder closes a chunk at the first frame beyond 256 KiB."""
LARGEST_CONTENT = 8 * 2**30
"""Maximum uncompressed size of all chunks of a file [bytes]."""
MAX_RECORDS = 2_000_000
"""Maximum number of records outside of chunks that are read."""
_SMALL_CONTENT = 64 * 2**20
"""Uncompressed size of all chunks up to which their compression ratio is not limited [bytes]."""
_MAX_COMPRESSION_RATIO = 300
"""Maximum ratio of the size of all chunks to that of the file. Recordings of the library have ratios of 5 to 12; a
hundred parked cars have 70, and up to 205 in a chunk."""
_MIN_BYTES_PER_RECORD = 4
"""Minimum size of a file per record in its chunks [bytes]. Recordings with the topics of all tools have at least 30."""
_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_CHANNEL = struct.Struct("<H")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<QQI")
_STATISTICS = struct.Struct("<QHIIIIQQ")
"""Statistics before the numbers of messages by channel."""
_COUNT = struct.Struct("<HQ")
_ZSTD = struct.pack("<I", 4) + b"zstd"
_KNOWN = range(1, 16)
_BLOCK = 1 << 20


class Record(NamedTuple):
    """Record outside of chunks, with its offset in the file [bytes]."""

    opcode: int
    offset: int
    body: bytes


class Message(NamedTuple):
    """Message record of a chunk."""

    channel: int
    sequence: int
    log_time: int
    data: bytes


class ContentLimitError(Exception):
    """Content of chunks beyond the maximum size or number of records."""


class McapFile:
    """MCAP file whose readable records are returned and whose damage is added to a report.

    The cost of a pass over all chunks is limited by the size of the file: their uncompressed sizes and the records of
    all channels count.

    Raise InputError if the file cannot be opened, is not a regular file, or is not MCAP.
    """

    def __init__(self, path: Path, damage: DamageReport) -> None:
        self._damage = damage
        if os.path.exists(path) and not is_regular_file(path):
            raise InputError(Diagnostic("cannot read: not a regular file", "give an MCAP recording", str(path)))
        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
            status = os.fstat(self._descriptor)
        except OSError as error:
            suffixes = (".mcap",) if path.suffix else ()  # a folder of a run has none
            hint = file_suggestion(path, suffixes, otherwise="give an MCAP recording")
            raise InputError(Diagnostic(f"cannot read: {error.strerror}", hint, str(path))) from error
        if not stat.S_ISREG(status.st_mode):
            self.close()
            raise InputError(Diagnostic("cannot read: not a regular file", "give an MCAP recording", str(path)))
        self._size = status.st_size
        self._content_left = min(LARGEST_CONTENT, max(_SMALL_CONTENT, _MAX_COMPRESSION_RATIO * self._size))
        self._records_left = self._size // _MIN_BYTES_PER_RECORD
        if self.read(0, len(MAGIC)) != MAGIC:
            self.close()
            raise InputError(Diagnostic("not an MCAP file", "give an MCAP recording", str(path)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

    def read(self, offset: int, length: int) -> bytes:
        """Return `length` bytes of the file, or fewer at its end."""
        return os.pread(self._descriptor, length, offset) if length > 0 else b""

    def records(self) -> Iterator[Record]:
        """Yield all records outside of chunks in file order, and check the checksums of the file."""
        sums = _FileSums(self._damage)
        offset = len(MAGIC)
        for _ in range(MAX_RECORDS):
            head = self.read(offset, _HEAD.size)
            if len(head) < _HEAD.size:
                self._damage.add("the end of the file is missing")
                return
            opcode, length = _HEAD.unpack(head)
            if opcode not in _KNOWN or offset + _HEAD.size + length > self._size:
                next_chunk = self._next_chunk(offset + 1)
                if next_chunk is None:
                    self._damage.add("the rest of the file contains no readable record", f"from byte {offset} on")
                    return
                self._damage.add("bytes do not form a record", f"{offset} to {next_chunk}")
                sums.broken = True
                offset = next_chunk
                continue
            if length > LARGEST_RECORD:
                self._damage.add(f"a record is larger than {LARGEST_RECORD // 2**20} MiB", f"byte {offset}")
                sums.broken = True
            else:
                body = self.read(offset + _HEAD.size, length)
                sums.add_record(opcode, head, body)
                yield Record(opcode, offset, body)
            offset += _HEAD.size + length
            if opcode == FOOTER:
                if self.read(offset, len(MAGIC) + 1) != MAGIC:
                    self._damage.add("the file does not end with its last record", f"byte {offset}")
                return
        self._damage.add(f"the file has more than {MAX_RECORDS} records")

    def record_at(self, offset: int) -> Record:
        """Return the record that `records` found at this offset. Raise struct.error if the file ends before it."""
        opcode, length = _HEAD.unpack(self.read(offset, _HEAD.size))
        return Record(opcode, offset, self.read(offset + _HEAD.size, min(length, LARGEST_RECORD)))

    def messages(self, record: Record, channel: int) -> list[Message]:
        """Return the readable messages of a channel in a chunk or a message record.

        Raise ContentLimitError if the chunks that were read so far have too much content.
        """
        if record.opcode == MESSAGE:
            self._count(len(record.body), 1)
            message = message_of(record.body)
            return [message] if message.channel == channel else []
        location = f"byte {record.offset}"
        data = self._content(record, location)
        return [message_of(data[start:end]) for start, end in self._message_bounds(data, channel, location)]

    def _count(self, size: int, records: int) -> None:
        """Subtract content from what the file may still have. Raise ContentLimitError if nothing is left."""
        self._content_left -= size
        self._records_left -= records
        if self._content_left < 0 or self._records_left < 0:
            raise ContentLimitError

    def _content(self, record: Record, location: str) -> bytes:
        """Return the uncompressed records of a chunk; nothing if it cannot be read."""
        try:
            _, _, size, checksum = _CHUNK_HEAD.unpack_from(record.body)
            compression, start = _text(record.body, _CHUNK_HEAD.size)
            (length,) = struct.unpack_from("<Q", record.body, start)
        except (struct.error, UnicodeDecodeError, ValueError):
            self._damage.add("a chunk cannot be read", location)
            return b""
        packed = record.body[start + 8 : start + 8 + length]
        if size > LARGEST_CHUNK:
            self._damage.add("a chunk is too large", location)
            return b""
        if len(packed) != length or compression not in ("", "zstd"):
            self._damage.add("a chunk cannot be read", location)
            return b""
        self._count(size, 0)
        try:
            data = packed if compression == "" else _decompress(packed, size)
        except (zstandard.ZstdError, MemoryError):
            self._damage.add("a chunk cannot be decompressed", location)
            return b""
        if len(data) != size or zlib.crc32(data) != checksum:
            self._damage.add("a chunk does not match its checksum", location)
        return data

    def _message_bounds(self, data: bytes, channel: int, location: str) -> list[tuple[int, int]]:
        """Return start and end of the message records of a channel in the content of a chunk."""
        bounds, offset, size, count, damage = [], 0, len(data), 0, ""
        unpack, unpack_channel = _HEAD.unpack_from, _CHANNEL.unpack_from
        while offset < size and count <= self._records_left:
            count += 1
            start = offset + _HEAD.size
            opcode, length = unpack(data, offset) if start <= size else (0, size)
            offset = start + length
            if offset > size:
                damage = "a chunk ends within a record"
                break
            if opcode == MESSAGE:
                if length < _MESSAGE_HEAD.size:
                    damage = "a message cannot be read"
                elif unpack_channel(data, start)[0] == channel:
                    bounds.append((start, offset))
        self._count(0, count)
        if damage:
            self._damage.add(damage, location)
        return bounds

    def _next_chunk(self, start: int) -> int | None:
        """Return the offset of the next compressed chunk from `start` on, or None."""
        before = _HEAD.size + _CHUNK_HEAD.size
        offset, held = start, b""
        while True:
            block = self.read(offset, _BLOCK)
            if not block:
                return None
            text = held + block
            base = offset - len(held)
            position = text.find(_ZSTD)
            while position >= 0:
                candidate = base + position - before
                if candidate >= start and self._is_chunk(candidate):
                    return candidate
                position = text.find(_ZSTD, position + 1)
            held = text[-(len(_ZSTD) - 1) :]
            offset += len(block)

    def _is_chunk(self, offset: int) -> bool:
        head = self.read(offset, _HEAD.size + _CHUNK_HEAD.size + len(_ZSTD) + 8)
        if len(head) < _HEAD.size + _CHUNK_HEAD.size + len(_ZSTD) + 8:
            return False
        opcode, length = _HEAD.unpack_from(head)
        (compressed,) = struct.unpack_from("<Q", head, len(head) - 8)
        inside = length == _CHUNK_HEAD.size + len(_ZSTD) + 8 + compressed
        return bool(opcode == CHUNK and inside and offset + _HEAD.size + length <= self._size)


class _FileSums:
    """Checksums of the data section and of the summary section."""

    def __init__(self, damage: DamageReport) -> None:
        self._damage = damage
        self._sum = zlib.crc32(MAGIC)
        self._ended = False
        self._summary = 0
        self.broken = False
        """Whether bytes were skipped, so that the checksums cannot match."""

    def add_record(self, opcode: int, head: bytes, body: bytes) -> None:
        if opcode == DATA_END:
            self._check_checksum("the data section does not match its checksum", self._sum, body[-4:])
            self._ended = True
        elif opcode == FOOTER and len(body) == _FOOTER.size:
            if not self._ended:
                self._damage.add("the end of the data section is missing")
            expected = zlib.crc32(head + body[:-4], self._summary)
            self._check_checksum("the summary does not match its checksum", expected, body[-4:])
        elif self._ended:
            self._summary = zlib.crc32(body, zlib.crc32(head, self._summary))
        else:
            self._sum = zlib.crc32(body, zlib.crc32(head, self._sum))

    def _check_checksum(self, damage: str, computed: int, stored: bytes) -> None:
        if self.broken or stored != struct.pack("<I", computed):
            self._damage.add(damage)


def _decompress(packed: bytes, size: int) -> bytes:
    """Return at most `size` + 1 bytes, whatever size the data state."""
    reader = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(packed)
    return bytes(reader.read(size + 1))


def message_of(body: bytes) -> Message:
    """Parse a message record. Raise struct.error if it is too short."""
    channel, sequence, log_time, _ = _MESSAGE_HEAD.unpack_from(body)
    return Message(channel, sequence, log_time, body[_MESSAGE_HEAD.size :])


def metadata_of(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and entries of a metadata record. Raise ValueError or struct.error if it cannot be read."""
    name, offset = _text(body, 0)
    (length,) = struct.unpack_from("<I", body, offset)
    offset += 4
    if offset + length != len(body):
        raise ValueError("length fields of the record are inconsistent")
    entries = {}
    while offset < len(body):
        key, offset = _text(body, offset)
        entries[key], offset = _text(body, offset)
    return name, entries


def attachment_of(body: bytes) -> tuple[str, bytes, bool]:
    """Return name and content of an attachment, and whether the checksum matches. Raise ValueError or struct.error."""
    name, offset = _text(body, 16)
    _, offset = _text(body, offset)
    (length,) = struct.unpack_from("<Q", body, offset)
    offset += 8
    if offset + length + 4 != len(body):
        raise ValueError("length fields of the record are inconsistent")
    return name, body[offset:-4], body[-4:] == struct.pack("<I", zlib.crc32(memoryview(body)[:-4]))


def message_count(body: bytes, channel: int) -> int:
    """Return the number of messages of a channel in a statistics record. Raise struct.error if it is too short."""
    (length,) = struct.unpack_from("<I", body, _STATISTICS.size)
    start = _STATISTICS.size + 4
    counts = dict(_COUNT.iter_unpack(body[start : start + length // _COUNT.size * _COUNT.size]))
    return int(counts.get(channel, 0))


def _text(body: bytes, offset: int) -> tuple[str, int]:
    """Return a length-prefixed string and the offset of its end."""
    (length,) = struct.unpack_from("<I", body, offset)
    offset += 4
    if offset + length > len(body):
        raise ValueError("string length exceeds the record")
    return body[offset : offset + length].decode(), offset + length
