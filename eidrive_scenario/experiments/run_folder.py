"""Folder of one run: named after all settings, locked during the run, with partial names for incomplete files."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from eidrive_scenario.errors import Diagnostic, InputError, OutputError
from eidrive_scenario.files.atomic import FileLock, partial_path, write_atomically
from eidrive_scenario.recording.run_files import IMAGES, RECORDING, RESULT, read_result
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings

_READABLE = 100
"""Maximum length of the readable part of a name [bytes]."""
_LOCK = ".lock"
_MAX_COPIES = 1000
"""Maximum number of folders with equal settings."""


def folder_name(settings: ResolvedSettings) -> str:
    """Return the name of a run folder: scenario, channel, run of a distribution, seed, and hash of all settings."""
    run = [] if settings.run is None else [f"run{settings.run}"]
    parts = [settings.scenario.rsplit("/", 1)[-1], settings.channel, *run, f"seed{settings.seed}"]
    return readable_name(parts, settings.short_digest)


def readable_name(parts: Sequence[str], digest: str) -> str:
    """Return the name of a folder: readable parts, shortened, and the digest that distinguishes it."""
    readable = re.sub(r"[^\w.+=-]+", "_", "-".join(parts)).strip("._-")
    readable = readable.encode(errors="replace")[:_READABLE].decode(errors="ignore").rstrip("._-") or "run"
    return f"{readable}-{digest}"


class RunFolder:
    """Folder of a run. Files are written under partial names, and `commit` renames them at the end."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def recording(self) -> Path:
        """Path of the recording during the run."""
        return partial_path(self.path / RECORDING)

    @property
    def images(self) -> Path:
        """Folder of the camera images during the run."""
        return partial_path(self.path / IMAGES)

    def prepare(self) -> None:
        """Remove the files of an earlier run that did not end, including its page by `eidrive view`."""
        _remove(self.recording, self.images)

    def commit(self, result: bytes) -> None:
        """Replace the files of an earlier run with the same settings.

        The page of the former recording by `eidrive view` is removed, too. The result is removed first and written
        last, so a result always belongs to the recording in its folder.
        """
        (self.path / RESULT).unlink(missing_ok=True)
        _remove(self.path / RECORDING, self.path / IMAGES)
        if self.recording.exists():
            self.recording.replace(self.path / RECORDING)
        if self.images.exists():
            self.images.replace(self.path / IMAGES)
        with write_atomically(self.path / RESULT) as stream:
            stream.write(result)

    def earlier_trace(self) -> str | None:
        """Return the trace hash of the result in the folder, or None without a result."""
        with suppress(InputError):
            return str(read_result(self.path / RESULT)["trace_hash"])
        return None


def _remove(recording: Path, images: Path) -> None:
    """Remove a recording with its page by `eidrive view`, and a folder of images."""
    recording.unlink(missing_ok=True)
    recording.with_suffix(".html").unlink(missing_ok=True)
    shutil.rmtree(images, ignore_errors=True)


@contextmanager
def run_folder(parent: Path, settings: ResolvedSettings, *, own: bool) -> Iterator[RunFolder]:
    """Create and lock a folder for a run with these settings until the block ends.

    own  True: a folder below `parent`, named after the settings. A number is appended if another run with equal
         settings is in progress, or if the folder has other content. False: `parent` itself

    Invalid input creates no files. Raise OutputError if the folder cannot be written, or if `parent` itself is in use
    or contains the result of other settings.
    """
    name, reason = folder_name(settings), ""
    names = (name if number == 1 else f"{name}-{number}" for number in range(1, _MAX_COPIES + 1))
    for path in (parent / name for name in names) if own else (parent,):
        lock = _lock(path)
        if lock is None:
            reason = "another run writes to this folder"
        elif _is_free(path, settings):
            break
        else:
            reason = "the folder contains the result of a run with other settings"
            lock.release()
    else:
        message = f"{_MAX_COPIES} folders of this name are in use" if own else reason
        raise OutputError(Diagnostic(message, "choose another folder", str(path)))
    folder = RunFolder(path)
    with lock:
        try:
            folder.prepare()
            yield folder
        except InputError:  # the run never started
            with suppress(OSError):
                folder.prepare()
                lock.release()
                path.rmdir()
            raise
        except OSError as error:
            if error.filename is None:
                error.filename = str(path)
            raise


def check_writable(folder: Path) -> None:
    """Create a folder, and raise OutputError if no file can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(
            Diagnostic(f"cannot write: {error.strerror}", "choose another folder", str(folder))
        ) from error


def _lock(path: Path) -> FileLock | None:
    try:
        while True:
            path.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # another process removed the empty folder
                return FileLock.acquire(path / _LOCK)
    except OSError as error:
        raise OutputError(Diagnostic(f"cannot write: {error.strerror}", "choose another folder", str(path))) from error


def _is_free(path: Path, settings: ResolvedSettings) -> bool:
    """True if a folder contains no result, or a result of equal settings."""
    if not (path / RESULT).exists():
        return not (path / RECORDING).exists() or (path / RECORDING).is_file()
    try:
        return bool(read_result(path / RESULT).get("settings_sha256") == settings.digest)
    except InputError:
        return False
