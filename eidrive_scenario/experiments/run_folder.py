"""The folder of one run: named after all its settings, locked while the run goes on, complete or recognizably not."""

from __future__ import annotations

import itertools
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.files.atomic import partial_path
from eidrive_scenario.files.lock import FileLock
from eidrive_scenario.recording.run_files import IMAGES, RECORDING, RESULT, read_result
from eidrive_scenario.resolved_settings import ResolvedSettings

_READABLE = 100
"""Maximum length of the readable part of a name [bytes]."""
_LOCK = ".lock"
_MOST_COPIES = 1000


def folder_name(settings: ResolvedSettings) -> str:
    """The name of a run's folder: scenario, channel, run of a distribution and seed, and the hash of all settings."""
    run = [] if settings.run is None else [f"run{settings.run}"]
    parts = [settings.scenario.rsplit("/", 1)[-1], settings.channel, *run, f"seed{settings.seed}"]
    readable = re.sub(r"[^\w.+=-]+", "_", "-".join(parts)).strip("._-")
    readable = readable.encode(errors="replace")[:_READABLE].decode(errors="ignore").rstrip("._-") or "run"
    return f"{readable}-{settings.short_digest}"


class RunFolder:
    """A locked folder. Files are written under partial names; `commit` gives all of them their own names at the end."""

    def __init__(self, path: Path, lock: FileLock) -> None:
        self.path = path
        self._lock = lock

    @property
    def recording(self) -> Path:
        """Path of the recording while the run goes on."""
        return partial_path(self.path / RECORDING)

    @property
    def pictures(self) -> Path:
        """Folder of the camera images while the run goes on."""
        return partial_path(self.path / IMAGES)

    def prepare(self) -> None:
        """Remove what an earlier run has left that did not end, with the page that `eidrive view` made of it."""
        self.recording.unlink(missing_ok=True)
        self.recording.with_suffix(".html").unlink(missing_ok=True)
        shutil.rmtree(self.pictures, ignore_errors=True)

    def commit(self, result: bytes) -> None:
        """Replace the files of an earlier run with the same settings.

        A page that `eidrive view` made of the former recording goes too. The result is removed first and written last,
        so a result always belongs to the recording beside it.
        """
        (self.path / RESULT).unlink(missing_ok=True)
        for outdated in (self.path / RECORDING, (self.path / RECORDING).with_suffix(".html")):
            outdated.unlink(missing_ok=True)
        shutil.rmtree(self.path / IMAGES, ignore_errors=True)
        if self.recording.exists():
            self.recording.replace(self.path / RECORDING)
        if self.pictures.exists():
            self.pictures.replace(self.path / IMAGES)
        unfinished = partial_path(self.path / RESULT)
        unfinished.write_bytes(result)
        unfinished.replace(self.path / RESULT)

    def earlier_trace(self) -> str | None:
        """The trace hash of the result that lies there, or None if there is none."""
        with suppress(InputError):
            return str(read_result(self.path / RESULT)["trace_hash"])
        return None

    def discard(self) -> None:
        """Leave nothing of a run that never began."""
        with suppress(OSError):
            self.recording.unlink(missing_ok=True)
            shutil.rmtree(self.pictures, ignore_errors=True)
            self._lock.release()
            self.path.rmdir()

    def release(self) -> None:
        """Give the folder free for other runs."""
        self._lock.release()


@contextmanager
def run_folder(place: Path, settings: ResolvedSettings, *, own: bool) -> Iterator[RunFolder]:
    """A folder for a run with these settings, locked until the block ends.

    own  True: a folder below `place`, named after the settings. A number is appended while another run with the same
         settings is going on, or where the name holds anything else. False: `place` itself

    Wrong input leaves nothing. Raise SettingError if the folder cannot be written, or if `place` itself is in use or
    holds the result of other settings.
    """
    folder = _claim_below(place, settings) if own else _claim(place, settings)
    try:
        folder.prepare()
        yield folder
    except InputError:
        folder.discard()
        raise
    except OSError as error:
        if error.filename is None:
            error.filename = str(folder.path)
        raise
    finally:
        folder.release()


def _claim_below(place: Path, settings: ResolvedSettings) -> RunFolder:
    name = folder_name(settings)
    for number in itertools.count(1):
        path = place / (name if number == 1 else f"{name}-{number}")
        lock = _lock(path)
        if lock is not None:
            if _is_free(path, settings):
                return RunFolder(path, lock)
            lock.release()
        if number == _MOST_COPIES:
            break
    raise SettingError(Diagnostic(f"{_MOST_COPIES} folders of this name are taken", "choose another folder", str(path)))


def _claim(path: Path, settings: ResolvedSettings) -> RunFolder:
    lock = _lock(path)
    if lock is None:
        raise SettingError(Diagnostic("another run writes into this folder", "choose another one", str(path)))
    if not _is_free(path, settings):
        lock.release()
        what = "the folder holds the result of a run with other settings"
        raise SettingError(Diagnostic(what, "choose another one", str(path)))
    return RunFolder(path, lock)


def _lock(path: Path) -> FileLock | None:
    try:
        while True:
            path.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # another process has removed the empty folder meanwhile
                return FileLock.acquire(path / _LOCK)
    except OSError as error:
        raise SettingError(Diagnostic(f"cannot write: {error.strerror}", "choose another folder", str(path))) from error


def _is_free(path: Path, settings: ResolvedSettings) -> bool:
    """Whether a folder holds no result, or that of the same settings."""
    if not (path / RESULT).exists():
        return not (path / RECORDING).exists() or (path / RECORDING).is_file()
    try:
        return bool(read_result(path / RESULT).get("settings_sha256") == settings.digest)
    except InputError:
        return False
