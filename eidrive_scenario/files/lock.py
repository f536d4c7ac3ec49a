"""Locks between processes. The kernel releases them with the process, so a killed process never blocks another."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from typing import Self

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
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | getattr(os, "O_NOFOLLOW", 0), 0o644)
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
