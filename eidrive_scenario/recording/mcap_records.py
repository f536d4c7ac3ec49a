"""The records of an MCAP file, read from an untrusted source: bounded in size, checked, and found again after damage.

The layout is that of the MCAP specification, version 0 (https://mcap.dev/spec).
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
from eidrive_scenario.recording.damage import DamageReport

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, STATISTICS, METADATA, DATA_END = 2, 3, 4, 5, 6, 9, 11, 12, 15
LARGEST_RECORD = 320 * 2**20
"""Maximum size of a record [bytes]; an attached road has up to 256 MiB."""
LARGEST_CHUNK = 128 * 2**20
"""Maximum size of a chunk without compression [bytes]; the recorder closes one at the first frame beyond 256 KiB."""
LARGEST_CONTENT = 8 * 2**30
"""Maximum size of all chunks of a file without compression [bytes]."""
MOST_RECORDS = 2_000_000
_SMALL_CHUNK = 4 * 2**20
"""Size up to which a chunk may be compressed to any degree [bytes]."""
_MOST_COMPRESSED = 300
"""Maximum compression of a larger chunk, which holds a single frame; those of scenario 1 are compressed 27-fold."""
_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_FOOTER = struct.Struct("<QQI")
_ZSTD = struct.pack("<I", 4) + b"zstd"
_KNOWN = range(1, 16)
_BLOCK = 1 << 20


class Record(NamedTuple):
    """A record outside of chunks, and where it begins in the file."""

    opcode: int
    offset: int
    body: bytes


class Message(NamedTuple):
    """A message of a chunk."""

    channel: int
    sequence: int
    log_time: int
    data: bytes


class McapFile:
    """A file of records. Whatever is wrong with it is added to the report; what can be read is given.

    Raises InputError if the file cannot be opened, is not a regular file, or is not MCAP.
    """

    def __init__(self, path: Path, damage: DamageReport) -> None:
        self._damage = damage
        if os.path.exists(path) and not is_regular_file(path):
            raise InputError(Diagnostic("cannot read: not a regular file", "give an MCAP recording", str(path)))
        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | getattr(os, "O_NONBLOCK", 0))
            status = os.fstat(self._descriptor)
        except OSError as error:
            raise InputError(
                Diagnostic(f"cannot read: {error.strerror}", "give an MCAP recording", str(path))
            ) from error
        if not stat.S_ISREG(status.st_mode):
            self.close()
            raise InputError(Diagnostic("cannot read: not a regular file", "give an MCAP recording", str(path)))
        self._size = status.st_size
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
        """Bytes of the file; fewer at its end."""
        return os.pread(self._descriptor, length, offset) if length > 0 else b""

    def records(self) -> Iterator[Record]:
        """All records outside of chunks, in the order of the file; the checksums of the file are checked on the way."""
        sums = _FileSums(self._damage)
        sums.add(MAGIC)
        offset = len(MAGIC)
        for _ in range(MOST_RECORDS):
            head = self.read(offset, _HEAD.size)
            if len(head) < _HEAD.size:
                self._damage.add("the end of the file is missing")
                return
            opcode, length = _HEAD.unpack(head)
            if opcode not in _KNOWN or offset + _HEAD.size + length > self._size:
                found = self._next_chunk(offset + 1)
                if found is None:
                    self._damage.add("no record can be read up to the end of the file", f"from byte {offset} on")
                    return
                self._damage.add("bytes are no record", f"{offset} to {found}")
                sums.broken = True
                offset = found
                continue
            if length > LARGEST_RECORD:
                self._damage.add(f"a record is larger than {LARGEST_RECORD // 2**20} MiB", f"byte {offset}")
                sums.broken = True
            else:
                body = self.read(offset + _HEAD.size, length)
                sums.take(opcode, offset, head, body)
                yield Record(opcode, offset, body)
            offset += _HEAD.size + length
            if opcode == FOOTER:
                if self.read(offset, len(MAGIC) + 1) != MAGIC:
                    self._damage.add("the file does not end with its last record", f"byte {offset}")
                return
        self._damage.add(f"the file has more than {MOST_RECORDS} records")

    def record_at(self, offset: int) -> Record:
        """The record that `records` found at this offset."""
        opcode, length = _HEAD.unpack(self.read(offset, _HEAD.size))
        return Record(opcode, offset, self.read(offset + _HEAD.size, min(length, LARGEST_RECORD)))

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
            place = text.find(_ZSTD)
            while place >= 0:
                candidate = base + place - before
                if candidate >= start and self._is_chunk(candidate):
                    return candidate
                place = text.find(_ZSTD, place + 1)
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
    """The checksums of the data section and of the summary."""

    def __init__(self, damage: DamageReport) -> None:
        self._damage = damage
        self._sum = 0
        self._ended = False
        self._summary = 0
        self.broken = False
        """Whether the sums cannot be right, as bytes were left out."""

    def add(self, data: bytes) -> None:
        self._sum = zlib.crc32(data, self._sum)

    def take(self, opcode: int, offset: int, head: bytes, body: bytes) -> None:
        if opcode == DATA_END:
            self._check("the data section does not match its checksum", self._sum, body[-4:])
            self._ended = True
        elif opcode == FOOTER and len(body) == _FOOTER.size:
            if not self._ended:
                self._damage.add("the end of the data section is missing")
            expected = zlib.crc32(head + body[:-4], self._summary)
            self._check("the summary does not match its checksum", expected, body[-4:])
        elif self._ended:
            self._summary = zlib.crc32(body, zlib.crc32(head, self._summary))
        else:
            self.add(head)
            self.add(body)

    def _check(self, what: str, found: int, stored: bytes) -> None:
        if self.broken or stored != struct.pack("<I", found):
            self._damage.add(what)


def chunk_messages(record: Record, damage: DamageReport) -> list[Message]:
    """The messages in a chunk, as far as they can be read."""
    place = f"byte {record.offset}"
    try:
        _, _, size, checksum = _CHUNK_HEAD.unpack_from(record.body)
        compression, start = _text(record.body, _CHUNK_HEAD.size)
        (length,) = struct.unpack_from("<Q", record.body, start)
    except (struct.error, UnicodeDecodeError, ValueError):
        damage.add("a chunk cannot be read", place)
        return []
    packed = record.body[start + 8 : start + 8 + length]
    if size > LARGEST_CHUNK or size > max(_SMALL_CHUNK, _MOST_COMPRESSED * len(packed)):
        damage.add("a chunk is too large, or compressed more than frames are", place)
        return []
    if len(packed) != length or compression not in ("", "zstd"):
        damage.add("a chunk cannot be read", place)
        return []
    try:
        data = packed if compression == "" else _unpacked(packed, size)
    except (zstandard.ZstdError, MemoryError):
        damage.add("a chunk cannot be decompressed", place)
        return []
    if len(data) != size or zlib.crc32(data) != checksum:
        damage.add("a chunk does not match its checksum", place)
    return list(_messages(data, damage, place))


def _unpacked(packed: bytes, size: int) -> bytes:
    """At most `size` and one bytes, whatever the data claim."""
    reader = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(packed)
    return bytes(reader.read(size + 1))


def _messages(data: bytes, damage: DamageReport, place: str) -> Iterator[Message]:
    offset = 0
    while offset < len(data):
        try:
            opcode, length = _HEAD.unpack_from(data, offset)
        except struct.error:
            damage.add("a chunk ends within a record", place)
            return
        offset += _HEAD.size
        if length > len(data) - offset:
            damage.add("a chunk ends within a record", place)
            return
        if opcode == MESSAGE:
            if length < _MESSAGE_HEAD.size:
                damage.add("a message cannot be read", place)
            else:
                yield message_of(data[offset : offset + length])
        offset += length


def message_of(body: bytes) -> Message:
    """A message record. Raises struct.error if it is too short."""
    channel, sequence, log_time, _ = _MESSAGE_HEAD.unpack_from(body)
    return Message(channel, sequence, log_time, body[_MESSAGE_HEAD.size :])


def metadata_of(body: bytes) -> tuple[str, dict[str, str]]:
    """Name and entries of a metadata record. Raises ValueError or struct.error if it cannot be read."""
    name, offset = _text(body, 0)
    (length,) = struct.unpack_from("<I", body, offset)
    offset += 4
    if offset + length != len(body):
        raise ValueError("the lengths do not agree")
    entries = {}
    while offset < len(body):
        key, offset = _text(body, offset)
        entries[key], offset = _text(body, offset)
    return name, entries


def attachment_of(body: bytes) -> tuple[str, bytes, bool]:
    """Name and content of an attachment, and whether they match their checksum. Raises ValueError or struct.error."""
    name, offset = _text(body, 16)
    _, offset = _text(body, offset)
    (length,) = struct.unpack_from("<Q", body, offset)
    offset += 8
    if offset + length + 4 != len(body):
        raise ValueError("the lengths do not agree")
    return name, body[offset:-4], body[-4:] == struct.pack("<I", zlib.crc32(memoryview(body)[:-4]))


def statistics_of(body: bytes) -> int:
    """The number of messages that the summary states. Raises struct.error."""
    return int(struct.unpack_from("<Q", body)[0])


def _text(body: bytes, offset: int) -> tuple[str, int]:
    """A text with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", body, offset)
    offset += 4
    if offset + length > len(body):
        raise ValueError("a text is longer than its record")
    return body[offset : offset + length].decode(), offset + length
