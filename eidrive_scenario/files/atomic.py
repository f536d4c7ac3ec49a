"""Atomic writing of output files, and locks between processes.

The kernel releases a lock with its process, so a killed process never blocks another one.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Self

from eidrive_scenario.errors import Diagnostic, InputError, OutputError
from eidrive_scenario.files.bounded import path_argument

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer


_BUSY = frozenset({errno.EWOULDBLOCK, errno.EACCES, errno.EAGAIN})


class FileLock:
    """Exclusive lock on a separate file, which exists as long as the lock is held.

    The lock file of a killed process has no effect: only the lock of a running process does. On a file system without
    locks, the process that creates the file holds the lock.
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self.path = path
        self._descriptor = descriptor

    @classmethod
    def acquire(cls, path: Path) -> FileLock | None:
        """Return the lock, or None if it is held elsewhere. Raise OSError if the file cannot be created."""
        while True:
            created = not path.exists()
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
            try:
                if not _lock(descriptor, created):
                    os.close(descriptor)
                    return None
                # The former holder may have removed the file between the open and the lock.
                if os.path.samestat(os.fstat(descriptor), os.stat(path)):
                    return cls(path, descriptor)
            except FileNotFoundError:
                pass
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)

    def release(self) -> None:
        """Remove the file and release the lock; a second call has no effect."""
        if self._descriptor < 0:
            return
        try:
            self.path.unlink(missing_ok=True)
        except OSError:
            pass  # a file without a lock does not block other processes
        finally:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def _lock(descriptor: int, created: bool) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _BUSY:
            return False
        return created
    return True


PARTIAL = ".partial"
"""Part of the name of a file before its suffix, during its run and after an aborted one."""


class _NamedFile(io.FileIO):
    """File whose errors, such as a full disk, have its name."""

    def write(self, data: Buffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            error.filename = os.fsdecode(self.name)
            raise


def create(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a new file for writing and create its folders. Raise OutputError if it cannot be written.

    A path such as /dev/stdout continues the stream.
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        return io.BufferedWriter(_NamedFile(os.fspath(path), "w", opener=_open))
    except OSError as error:
        raise OutputError(Diagnostic(f"cannot write: {error.strerror}", "choose another place", str(path))) from error


def _open(path: str, flags: int) -> int:
    # Opened again, the file of a redirected stream would be truncated and written from its start
    stream = standard_stream(path)
    return os.open(path, flags, 0o666) if stream is None else os.dup(stream)


def standard_stream(path: str | os.PathLike[str]) -> int | None:
    """Return the descriptor of standard output or error if a path leads there, such as /dev/stdout; else None."""
    for descriptor in (1, 2):
        with suppress(OSError):
            if os.path.samestat(os.stat(path), os.fstat(descriptor)):
                return descriptor
    return None


def partial_path(path: Path) -> Path:
    """Return the path of a file during its run: `out.partial.csv` for `out.csv`."""
    return path.with_stem(path.stem + PARTIAL)


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Yield the path to which a file is written until it is complete; then the file gets its final name.

    After an error or an interruption the file keeps the partial name, so that it is not mistaken for a complete run;
    after invalid input it is removed. Errors of the file state the final name. Two runs never write the same file at
    the same time. A link stays, and its target is written in this way. A path that is not a regular file, such as
    /dev/stdout, is written directly. Raise OutputError if the path is a folder, or if another run writes there.
    """
    if os.path.isdir(path):
        raise OutputError(Diagnostic("cannot write: Is a directory", "choose another place", str(path)))
    target = _target(path)
    if os.path.islink(target) or (os.path.exists(target) and not os.path.isfile(target)):
        yield path
        return
    unfinished = partial_path(target)
    with exclusive(target):
        try:
            yield unfinished
        except InputError as error:
            with suppress(OSError):
                unfinished.unlink()
            if not isinstance(error, OutputError):
                raise
            sources = {str(unfinished): str(path)}
            renamed = [replace(one, source=sources.get(one.source, one.source)) for one in error.diagnostics]
            raise OutputError(renamed) from error
        except OSError as error:
            if error.filename == str(unfinished):
                error.filename = str(path)
            raise
        unfinished.replace(target)


def _target(path: Path) -> Path:
    """Return the file to which a link leads; the path itself if it is none, or leads to an open file."""
    is_open_file = standard_stream(path) is not None or os.path.realpath(path.parent).startswith("/proc/")
    return Path(os.path.realpath(path)) if os.path.islink(path) and not is_open_file else path


@contextmanager
def write_atomically(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing that replaces that of its name when the block ends without an error.

    Otherwise a file of this name is unchanged. Raise OutputError if it cannot be written.
    """
    path = path_argument(path, "path")
    with atomic_output(path) as unfinished:
        try:
            with create(unfinished) as stream:
                yield stream
        except BaseException:
            if unfinished != path:
                with suppress(OSError):
                    unfinished.unlink()
            raise


@contextmanager
def exclusive(path: str | os.PathLike[str]) -> Iterator[None]:
    """Lock a file against other processes that use this function.

    Paths that are not regular files, and folders in which no lock can be created, are not locked. Raise OutputError
    if another process has the lock.
    """
    path = path_argument(path, "path")
    if os.path.exists(path) and not os.path.isfile(path):
        yield
        return
    lock = None
    name = hashlib.sha256(path.name.encode(errors="surrogateescape")).hexdigest()[:16]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock.acquire(path.parent / f".{name}.lock")
        if lock is None:
            raise OutputError(Diagnostic("another run writes this file", "choose another file", str(path)))
    try:
        yield
    finally:
        if lock is not None:
            lock.release()
