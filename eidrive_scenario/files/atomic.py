"""Files that a run leaves behind."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.files.lock import FileLock

PARTIAL = ".partial"
"""In the name of a file, before its suffix, while its run goes on; and afterwards, if that did not end."""


def create(path: str | Path) -> BinaryIO:
    """A new file there, its folders too. Raises SettingError if it cannot be written."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        return Path(path).open("wb")
    except OSError as error:
        raise SettingError(Diagnostic(f"cannot write: {error.strerror}", "choose another place", str(path))) from error


def partial_path(path: Path) -> Path:
    """Where a file lies whose run has not ended: `out.partial.csv` for `out.csv`."""
    return path.with_stem(path.stem + PARTIAL)


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Where to write a file that shall have its own name only once all of it is there.

    What was written before an error or an interruption is kept under the other name, so that nobody takes it for a
    whole run; of wrong input nothing is kept. Two runs never write one file at the same time. What is no plain file,
    such as /dev/stdout, is written as it is. Raises SettingError if the place is a folder, or another run writes there.
    """
    if os.path.isdir(path):
        raise SettingError(Diagnostic("cannot write: Is a directory", "choose another place", str(path)))
    if os.path.islink(path) or (os.path.exists(path) and not os.path.isfile(path)):
        yield path
        return
    unfinished = partial_path(path)
    with exclusive(path):
        try:
            yield unfinished
        except InputError:
            with suppress(OSError):
                unfinished.unlink()
            raise
        unfinished.replace(path)


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Keep other processes from writing the same file through this function.

    Raises SettingError if another one does. What is no plain file, and a place where no lock can be made, is not
    locked.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        yield
        return
    lock = None
    name = hashlib.sha256(path.name.encode(errors="surrogateescape")).hexdigest()[:16]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock.acquire(path.parent / f".{name}.lock")
        if lock is None:
            raise SettingError(Diagnostic("another run writes this file", "choose another file", str(path)))
    try:
        yield
    finally:
        if lock is not None:
            lock.release()
