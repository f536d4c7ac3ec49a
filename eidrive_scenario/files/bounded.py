"""Bounded reading of regular files, and of JSON in them.

Scenarios and all files that they refer to come from untrusted sources. A path may refer to a pipe, which blocks, a
device, which is endless, or a file that does not fit into memory. All input files are therefore read here.
"""

from __future__ import annotations

import errno
import json
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from eidrive_scenario.errors import Diagnostic, SettingError, quoted

MIB = 2**20
_CHUNK = MIB
_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


class RefusedFileError(OSError):
    """Path that does not refer to a regular file within the size limit; `strerror` states the reason."""

    def __init__(self, reason: str, path: str | os.PathLike[str]) -> None:
        super().__init__(errno.EINVAL, reason, os.fspath(path))


def is_regular_file(path: str | os.PathLike[str]) -> bool:
    """Whether a path refers to a regular file; False for an invalid path, such as one that is too long."""
    return os.path.isfile(path)


def read_regular_file(path: str | os.PathLike[str], limit: int) -> bytes:
    """Return the content of a regular file of at most `limit` bytes.

    The function never blocks and never reads more than `limit` + 1 bytes, even if the file changes meanwhile. Raise
    OSError if the file cannot be read, and RefusedFileError if it is not a regular file or is larger.
    """
    with _open_regular(path) as descriptor:
        size = os.fstat(descriptor).st_size
        parts: list[bytes] = []
        count = 0
        while size <= limit and count <= limit:
            part = os.read(descriptor, min(_CHUNK, limit + 1 - count))
            if not part:
                return b"".join(parts)
            parts.append(part)
            count += len(part)
    raise RefusedFileError(f"the file is larger than {_size(limit)}", path)


def reason_of(error: Exception) -> str:
    """Return the reason why a file cannot be read, without its path; only for errors that quote no content."""
    return getattr(error, "strerror", None) or str(error)


def file_in_memory() -> BinaryIO:
    """Return a file with a descriptor and without a name; on systems without such files, a temporary one."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("eidrive"), "w+b")
    return cast(BinaryIO, tempfile.TemporaryFile())


@contextmanager
def _open_regular(path: str | os.PathLike[str]) -> Iterator[int]:
    """Yield the descriptor of a regular file.

    The kind is checked before the file is opened, as opening a device may already have an effect, and again afterwards,
    as the file may have been replaced in between.
    """
    try:
        _check_kind(os.stat(path), path)
        descriptor = os.open(path, _FLAGS)
    except ValueError as error:  # a null byte
        raise RefusedFileError("the path is not valid", str(path).replace("\0", "\\0")) from error
    try:
        _check_kind(os.fstat(descriptor), path)
        yield descriptor
    finally:
        os.close(descriptor)


def _check_kind(status: os.stat_result, path: str | os.PathLike[str]) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = next((name for matches, name in _KINDS if matches(status.st_mode)), "of another kind")
        raise RefusedFileError(f"the path leads to {kind} (expected a regular file)", path)


def _size(limit: int) -> str:
    return f"{limit // MIB} MiB" if limit >= MIB else f"{limit // 1024} KiB"


def path_argument(value: str | os.PathLike[str], name: str, expected: str = "a path") -> Path:
    """Return an argument of a public function as a path. Raise SettingError for an object of another type.

    name      name of the argument
    expected  hint, such as what the path refers to
    """
    if not isinstance(value, str | os.PathLike) or not isinstance(os.fspath(value), str):
        raise SettingError(Diagnostic(f"{name} is {quoted(value)}", f"give {expected}"))
    return Path(value)


def absolute(path: str | Path) -> Path:
    """Return the path without symbolic links if it can be resolved, else the path itself."""
    try:
        return Path(path).resolve()
    except (OSError, ValueError, RuntimeError):
        return Path(path)


MAX_VALUES = 10_000_000
"""Maximum number of values in a document. Each takes less than 100 bytes of memory in addition to its text."""


def load_json(data: bytes, max_values: int = MAX_VALUES, *, max_depth: int | None = None) -> Any:
    """Return the values of a JSON document.

    Raise ValueError if the document is not valid JSON, has more than `max_values` values, or is nested deeper than
    `max_depth` or than Python can read.
    """
    check_values(data, max_values)
    try:
        document = json.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise ValueError(f"the document is not UTF-8 (byte {error.start})") from None
    except RecursionError:
        raise ValueError("the document is nested too deeply") from None
    if max_depth is not None and _is_deeper(document, max_depth):
        raise ValueError(f"the document is nested deeper than {max_depth} levels")
    return document


def check_values(data: bytes, max_values: int) -> None:
    """Raise ValueError if a JSON document may have more than `max_values` values."""
    if data.count(b",") + data.count(b"[") + data.count(b"{") > max_values:
        raise ValueError(f"the document has more than {max_values} values")


def _is_deeper(document: Any, levels: int) -> bool:
    layer = [document] if isinstance(document, dict | list) else []
    for _ in range(levels):
        items = (item.values() if isinstance(item, dict) else item for item in layer)
        layer = [item for inside in items for item in inside if isinstance(item, dict | list)]
        if not layer:
            return False
    return True
