"""Damaged copies of a recording: bytes flipped, cut, inserted; records removed, swapped, duplicated or edited."""

from __future__ import annotations

import json
import random
import struct
import zlib
from collections.abc import Callable
from typing import Any

import zstandard

CHUNK, ATTACHMENT, METADATA = 6, 9, 12
Records = list[tuple[int, bytes]]


def split(data: bytes) -> Records:
    """Return the records of an undamaged MCAP file, each with its opcode."""
    records, offset = [], 8
    while offset < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, offset)
        records.append((opcode, data[offset + 9 : offset + 9 + length]))
        offset += 9 + length
    return records


def join(records: Records) -> bytes:
    """Return a file of these records, with unchanged index and file checksums."""
    magic = b"\x89MCAP0\r\n"
    return magic + b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records) + magic


def _flip(data: bytes, draw: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(draw.choice([1, 1, 3, 20])):
        changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


def _cut(data: bytes, draw: random.Random) -> bytes:
    return data[: draw.randrange(len(data))]


def _cut_by_a_little(data: bytes, draw: random.Random) -> bytes:
    return data[: -draw.randrange(1, 40)]


def _insert(data: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(data))
    return data[:place] + draw.randbytes(draw.choice([1, 8, 300])) + data[place:]


def _append(data: bytes, draw: random.Random) -> bytes:
    return data + draw.randbytes(draw.choice([1, 9, 100]))


def _remove(data: bytes, draw: random.Random) -> bytes:
    place = draw.randrange(len(data))
    return data[:place] + data[place + draw.choice([1, 8, 300]) :]


def _blank(data: bytes, draw: random.Random) -> bytes:
    place, length = draw.randrange(len(data)), draw.choice([4, 64, 4096])
    return data[:place] + bytes(len(data[place : place + length])) + data[place + length :]


def _huge_length(data: bytes, draw: random.Random) -> bytes:
    """Replace the length field of a record by an invalid length."""
    offsets, offset = [], 8
    for _, body in split(data):
        offsets.append(offset)
        offset += 9 + len(body)
    place = draw.choice(offsets) + 1
    length = draw.choice([2**63, 2**40, 2**31, len(data), 0])
    return data[:place] + struct.pack("<Q", length) + data[place + 8 :]


def _chunks(records: Records) -> list[int]:
    return [place for place, (opcode, _) in enumerate(records) if opcode == CHUNK]


def _drop_chunk(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    del records[draw.choice(_chunks(records))]
    return join(records)


def _swap_chunks(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    first, second = draw.sample(_chunks(records), 2)
    records[first], records[second] = records[second], records[first]
    return join(records)


def _double_chunk(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    place = draw.choice(_chunks(records))
    records.insert(draw.randrange(len(records)), records[place])
    return join(records)


def _drop_record(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    del records[draw.randrange(len(records))]
    return join(records)


def unpack(body: bytes) -> bytes:
    """Return the messages of a chunk."""
    return zstandard.ZstdDecompressor().decompress(body[44:])


def pack(body: bytes, content: bytes, size: int | None = None) -> bytes:
    """Return the chunk with other messages and a valid chunk checksum."""
    packed = zstandard.compress(content)
    head = body[:16] + struct.pack("<QI", len(content) if size is None else size, zlib.crc32(content))
    return head + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed


def messages(content: bytes) -> list[tuple[int, bytes]]:
    """Return the records of a chunk."""
    found, offset = [], 0
    while offset < len(content):
        opcode, length = struct.unpack_from("<BQ", content, offset)
        found.append((opcode, content[offset + 9 : offset + 9 + length]))
        offset += 9 + length
    return found


def _edit_frame(data: bytes, draw: random.Random) -> bytes:
    """Edit the text of one frame; the MCAP checksum of the chunk stays valid."""
    records = split(data)
    place = draw.choice(_chunks(records))
    body = records[place][1]
    found = messages(unpack(body))
    row = draw.choice([row for row, (opcode, _) in enumerate(found) if opcode == 5])
    head, text = found[row][1][:22], found[row][1][22:]
    found[row] = (5, head + draw.choice(EDITS)(text, draw))
    content = b"".join(struct.pack("<BQ", opcode, len(inner)) + inner for opcode, inner in found)
    records[place] = (CHUNK, pack(body, content))
    return join(records)


def _tree(change: Callable[[Any, random.Random], None]) -> Callable[[bytes, random.Random], bytes]:
    def edit(text: bytes, draw: random.Random) -> bytes:
        tree = json.loads(text)
        change(tree, draw)
        return json.dumps(tree).encode()

    return edit


def _number(tree: Any, draw: random.Random) -> None:
    tree["view"]["position"][0][draw.randrange(3)] += draw.choice([1e-9, 1.0, 1e300])


def _wrong_type(tree: Any, draw: random.Random) -> None:
    key = draw.choice(list(tree["view"]))
    tree["view"][key] = draw.choice([None, "x", 3, [], {}, [[1]], {"shape": [10**9, 7]}, {"shape": -1}, "NaN", 10**400])


def _missing(tree: Any, draw: random.Random) -> None:
    del tree["view"][draw.choice(list(tree["view"]))]


def _extra(tree: Any, draw: random.Random) -> None:
    tree[draw.choice(["view", "unknown", "__class__"])] = draw.choice([[], {"x": 1}, None])


def _fewer(tree: Any, draw: random.Random) -> None:
    tree["view"][draw.choice(["names", "yaw", "position", "categories", "size"])].pop()


def _not_finite(tree: Any, draw: random.Random) -> None:
    tree["view"]["position"][0] = ["NaN", "Infinity", "-Infinity"]
    tree["view"]["time"] = draw.choice(["NaN", "Infinity", 1e308, -1.0])


def _script(tree: Any, draw: random.Random) -> None:
    names = ["</script><script>alert(1)</script>", "\ud800", "__proto__", "", "a" * 10**6]
    tree["view"]["names"][0] = draw.choice(names)


EDITS: list[Callable[[bytes, random.Random], bytes]] = [
    _tree(_number),
    _tree(_wrong_type),
    _tree(_missing),
    _tree(_extra),
    _tree(_fewer),
    _tree(_not_finite),
    _tree(_script),
    lambda text, draw: b"[" * draw.choice([100, 100_000]) + text,
    lambda text, draw: text[: draw.randrange(len(text))],
    lambda text, draw: text.replace(b'"tick":', b'"tick":1', 1),
    lambda text, draw: draw.choice([b"", b"null", b"[]", b"{}", b"\xff\xfe", b'"text"', b"1e999", b"9" * 5000]),
]


def _edit_attachment(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    places = [place for place, (opcode, _) in enumerate(records) if opcode == ATTACHMENT]
    place = draw.choice(places)
    content = bytearray(records[place][1][:-4])
    content[-draw.randrange(1, 200)] ^= 1
    records[place] = (ATTACHMENT, bytes(content) + struct.pack("<I", zlib.crc32(content)))
    return join(records)


def _edit_metadata(data: bytes, draw: random.Random) -> bytes:
    records = split(data)
    place = draw.choice([place for place, (opcode, _) in enumerate(records) if opcode == METADATA])
    content = bytearray(records[place][1])
    for _ in range(draw.choice([1, 5])):
        content[draw.randrange(len(content))] = draw.randrange(256)
    records[place] = (METADATA, bytes(content))
    return join(records)


def _bomb(data: bytes, draw: random.Random) -> bytes:
    """Insert a chunk that decompresses to a much larger size, with a valid or an invalid size field."""
    records = split(data)
    place = draw.choice(_chunks(records))
    records[place] = (CHUNK, pack(records[place][1], bytes(1 << 28), draw.choice([None, 100, 2**62])))
    return join(records)


MUTATIONS: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "flip": _flip,
    "cut": _cut,
    "cut by a little": _cut_by_a_little,
    "insert": _insert,
    "append": _append,
    "remove": _remove,
    "blank": _blank,
    "huge length": _huge_length,
    "drop chunk": _drop_chunk,
    "swap chunks": _swap_chunks,
    "double chunk": _double_chunk,
    "drop record": _drop_record,
    "edit frame": _edit_frame,
    "edit attachment": _edit_attachment,
    "edit metadata": _edit_metadata,
    "bomb": _bomb,
}
"""Mutations by name."""
WEIGHTED = [*MUTATIONS, "flip", "flip", "edit frame", "edit frame", "edit frame"]


def mutant(data: bytes, number: int) -> tuple[str, bytes]:
    """Return the kind of mutation and a damaged copy, determined by the number."""
    draw = random.Random(number)
    kind = WEIGHTED[number % len(WEIGHTED)] if number % len(WEIGHTED) else draw.choice(WEIGHTED)
    return kind, MUTATIONS[kind](data, draw)
