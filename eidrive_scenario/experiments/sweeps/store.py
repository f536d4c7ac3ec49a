"""Store of the results of sweeps: an SQLite file with one row per run."""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any, Self

import msgspec

from eidrive_scenario.errors import Diagnostic, EidriveError, SettingError, SimulationError, quoted
from eidrive_scenario.files.atomic import exclusive
from eidrive_scenario.files.bounded import is_regular_file, load_json
from eidrive_scenario.files.encodable import encodable
from eidrive_scenario.files.similar_paths import file_suggestion

FORMAT = 1
"""Version of the tables."""
_HEADER = b"SQLite format 3\0"
APPLICATION = 0x65694452
"""Application id in the header of the file, `eiDR`."""
PASSED, FAILED, NOT_JUDGED = "passed", "failed", "not judged"
ABORTED, CRASHED, INVALID, EXCLUDED = "aborted", "crashed", "invalid", "excluded"
STATUSES = (PASSED, FAILED, NOT_JUDGED, ABORTED, CRASHED, INVALID, EXCLUDED)
"""Outcomes of a run: verdict of its criteria; end without a criterion; aborted by an error or its wall limit; end of
its worker process; invalid input; excluded by constraints of parameters."""
FOLDER = "folder"
"""Column of a result with the folder of the files of the run, relative to that of the store."""
REPEATABLE = (ABORTED, CRASHED)
"""Outcomes that need not be those of a repetition."""

_TABLES = """
CREATE TABLE IF NOT EXISTS meta (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS runs (
    key TEXT PRIMARY KEY, number INTEGER NOT NULL, scenario TEXT NOT NULL, run INTEGER, seed INTEGER NOT NULL,
    status TEXT NOT NULL, point TEXT NOT NULL, result TEXT NOT NULL, error TEXT NOT NULL, command TEXT NOT NULL,
    wall_s REAL NOT NULL, settings BLOB NOT NULL
) WITHOUT ROWID;
"""


_MAX_SETTINGS = 64 * 2**20
"""Maximum size of the settings of a run [bytes]; a delay trace of 32 MiB is part of them."""
_SMALL_SETTINGS, _MAX_COMPRESSION_RATIO = 256 * 2**20, 100
"""Total size of the settings of all runs up to which their compression ratio is not limited [bytes], and maximum ratio
of a larger size to that of the file. Settings of the library have ratios of 3 to 5."""
_STEPS, _SMALL_STEPS, _STEPS_PER_BYTE = 100_000, 10_000_000, 50
"""Steps of SQLite between two checks of their number, number that every file may take, and further ones per byte of the
file. A run takes about 50 steps and at least 1 kB."""
_OTHER_FILE = "give a file of `eidrive sweep --store`, or a new one for a sweep"
"""Hint for a file that is no store; commands that read stores and sweeps give it."""
_INSERT = f"INSERT OR REPLACE INTO runs VALUES ({', '.join('?' * 12)})"


class StoredRun(msgspec.Struct, frozen=True):
    """Run of a sweep in the store.

    key       digest of the inputs;  number  position in its sweep
    run       number in a distribution; None for a scenario
    status    one of STATUSES
    point     values of the axes
    result    outcome, criteria and metrics as columns: `RunResult.to_dict`; if the run did not end, only the parameters
              that its distribution varies
    error     message of a run without a verdict
    command   command line that repeats the run
    wall_s    duration with loading [s]
    settings  all settings of the run as JSON, with versions and digests of all files; empty if it did not start
    """

    key: str
    number: int
    scenario: str
    run: int | None
    seed: int
    status: str
    point: dict[str, Any]
    result: dict[str, Any]
    error: str
    command: str
    wall_s: float
    settings: str = ""

    @property
    def has_verdict(self) -> bool:
        """Whether criteria judged the run."""
        return self.status in (PASSED, FAILED)

    @property
    def criteria(self) -> list[str]:
        """Names of the criteria of the run. Metrics may end in `.passed`, too, but are no truth values."""
        end = ".passed"
        return [
            name.removesuffix(end)
            for name, value in self.result.items()
            if name.endswith(end) and isinstance(value, bool)
        ]


class ResultStore:
    """Results of sweeps. Only one process writes; the results of runs are on the disk when `add` returns.

    The journal is a separate file, as in all SQLite files that network file systems may hold.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    @classmethod
    @contextmanager
    def open(cls, path: Path, versions: Mapping[str, str]) -> Iterator[Self]:
        """Open a store for writing, and create it if there is none; other processes may read it.

        An EidriveError of the caller deletes a new store again if it has no runs.

        versions  versions of the packages that affect results: a store contains results of one set of them

        Raise SettingError if the file cannot be written, is not a store, or is one of other versions, or if another
        process writes it.
        """
        if os.path.exists(path) and not os.path.isfile(path):
            raise _error("cannot write: not a regular file", "choose another file", path)
        with ExitStack() as stack:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise _error(f"cannot write: {error.strerror}", "choose another file", path) from error
            stack.enter_context(exclusive(path))
            is_new, store = not os.path.exists(path), None
            try:
                with _usable(path):
                    connection = _connect(path)
                    stack.callback(connection.close)
                    opened = cls(path, connection)
                    opened._create()
                opened._check_versions(versions)
                store = opened
                yield store
            except EidriveError:
                if is_new and (store is None or not store.statuses()):
                    with suppress(OSError):
                        path.unlink()
                raise

    @classmethod
    @contextmanager
    def read(cls, path: Path) -> Iterator[Self]:
        """Open a store for reading. Raise SettingError if there is none."""
        if not is_regular_file(path):
            hint = file_suggestion(path, {path.suffix, ".db"}, otherwise="give the file of a sweep")
            raise _error("no such store", hint, path)
        with ExitStack() as stack:
            with _usable(path):
                connection = _connect(path, read_only=True)
                stack.callback(connection.close)
                _check_format(path, connection)
            yield cls(path, connection)

    def _create(self) -> None:
        if not self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")  # without it, each statement is a transaction
                self._connection.execute(f"PRAGMA application_id={APPLICATION}")
                self._connection.execute(f"PRAGMA user_version={FORMAT}")
                for statement in _TABLES.split(";"):
                    self._connection.execute(statement)
        _check_format(self.path, self._connection)

    def _check_versions(self, versions: Mapping[str, str]) -> None:
        """Store the versions, or compare them with the stored ones."""
        held = self.versions
        if not held:
            with self._connection:
                self._connection.execute(
                    "INSERT OR REPLACE INTO meta VALUES ('versions', ?)", (json.dumps(dict(versions)),)
                )
        elif held != dict(versions):
            different = sorted(name for name in {*held, *versions} if held.get(name) != versions.get(name))
            texts = [f"{name} {held.get(name, 'none')} (now {versions.get(name, 'none')})" for name in different]
            raise _error(f"the store has results of {', '.join(texts)}", "give a new file", self.path)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the packages that computed the results."""
        for (text,) in self._select("SELECT value FROM meta WHERE name = 'versions'"):
            try:
                return msgspec.json.decode(text, type=dict[str, str])
            except (msgspec.MsgspecError, TypeError) as error:
                raise _damaged(f"the versions are invalid: {error}", self.path) from error
        return {}

    def add(self, *runs: StoredRun) -> None:
        """Add runs in one transaction, or replace those with their keys.

        Raise SimulationError if they cannot be written.
        """
        rows = [_row(run) for run in runs]
        try:
            with self._connection:
                self._connection.executemany(_INSERT, rows)
        except sqlite3.Error as error:
            raise SimulationError(
                f"{self.path}: cannot write a result: {error}; the results of all earlier runs are stored, and the "
                "same command continues"
            ) from error

    def statuses(self) -> dict[str, str]:
        """Return the status of each run by its key. Raise SettingError if any run is damaged."""
        return {run.key: run.status for run in self.runs()}

    def runs(self) -> Iterator[StoredRun]:
        """Yield all runs in the order of their sweep."""
        left = max(_SMALL_SETTINGS, _MAX_COMPRESSION_RATIO * self.path.stat().st_size)
        for row in self._select("SELECT * FROM runs ORDER BY number, key"):
            run = self._read_run(row, left)
            left -= len(run.settings)
            yield run

    def rows(self, keys: Sequence[str]) -> list[StoredRun]:
        """Return the runs with these keys in their order. Raise KeyError if one is missing."""
        runs = []
        for key in keys:
            rows = [*self._select("SELECT * FROM runs WHERE key = ?", key)]
            if not rows:
                raise KeyError(key)
            runs.append(self._read_run(rows[0]))
        return runs

    def _select(self, statement: str, *values: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query. Raise SettingError if the file is damaged."""
        try:
            yield from self._connection.execute(statement, values)
        except sqlite3.Error as error:
            raise _damaged(_reason(error), self.path) from error

    def _read_run(self, row: Sequence[Any], largest: int = _MAX_SETTINGS) -> StoredRun:
        """Return the run of a row with settings of at most `largest` bytes. Raise SettingError if it is damaged."""
        try:
            return _stored_run(row, min(largest, _MAX_SETTINGS))
        except (ValueError, TypeError, RecursionError, zlib.error, msgspec.MsgspecError) as error:
            raise _damaged(f"the row of run {encodable(str(row[1]))}: {encodable(str(error))}", self.path) from error


def is_store(path: Path) -> bool:
    """Whether a file is an SQLite file, as all stores are."""
    if not is_regular_file(path):
        return False
    with path.open("rb") as stream:
        return stream.read(len(_HEADER)) == _HEADER


def _row(run: StoredRun) -> tuple[Any, ...]:
    columns = msgspec.structs.asdict(run)
    columns |= {name: json.dumps(columns[name]) for name in ("point", "result")}
    columns |= {name: encodable(columns[name]) for name in ("error", "command")}
    columns["settings"] = zlib.compress(encodable(run.settings).encode())
    return tuple(columns.values())


def _stored_run(row: Sequence[Any], largest: int) -> StoredRun:
    *head, point, result, error, command, wall_s, settings = row
    columns = _scalars("point", point), _scalars("result", result)
    data = _decompressed(settings, largest)
    text = data.decode()
    if text and not isinstance(load_json(data), dict):
        raise ValueError("settings: not an object")
    values = (*head, *columns, error, command, wall_s, text)
    run = msgspec.convert(dict(zip(StoredRun.__struct_fields__, values, strict=True)), StoredRun)
    if run.status not in STATUSES:
        raise ValueError(f"unknown status {run.status!r}")
    return run


def _decompressed(data: bytes, largest: int) -> bytes:
    """Return at most `largest` bytes. Raise ValueError for more of them, and zlib.error for invalid data."""
    unpacking = zlib.decompressobj()
    unpacked = unpacking.decompress(data, largest + 1)
    if len(unpacked) > largest:
        raise ValueError(f"settings: larger than {largest // 2**20} MiB")
    if not unpacking.eof:
        raise zlib.error("settings: incomplete")
    return unpacked


def _scalars(column: str, text: str) -> dict[str, Any]:
    """Return the entries of a JSON object. Raise ValueError for other texts, and for nested values."""
    try:
        return msgspec.convert(json.loads(text), dict[str, str | int | float | bool | None])
    except ValueError as error:
        raise ValueError(f"{column}: {error}") from error


def _connect(path: Path, *, read_only: bool = False) -> sqlite3.Connection:
    """Return a connection whose statements end, even those of a forged file with pages that refer to each other."""
    uri = f"{path.absolute().as_uri()}{'?mode=ro' if read_only else ''}"
    connection = sqlite3.connect(uri, uri=True, timeout=30.0)
    calls = count(1)

    def is_exceeded() -> bool:
        return next(calls) * _STEPS > _SMALL_STEPS + _STEPS_PER_BYTE * path.stat().st_size

    connection.set_progress_handler(is_exceeded, _STEPS)
    return connection


def _check_format(path: Path, connection: sqlite3.Connection) -> None:
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    if application != APPLICATION:
        raise _error("the file is not a store of a sweep", _OTHER_FILE, path)
    held = connection.execute("PRAGMA user_version").fetchone()[0]
    if held != FORMAT:
        hint = "read it with the version that wrote it, or give a new file"
        raise _error(f"the store has format {held} (expected {FORMAT})", hint, path)
    _check_tables(path, connection)


def _check_tables(path: Path, connection: sqlite3.Connection) -> None:
    """Raise SettingError if the file has other tables or triggers than a store, a view in their place, or damage.

    The check of the pages excludes pages that belong to several rows, with which a small file has endless content.
    """
    expected = {" ".join(text.replace("IF NOT EXISTS ", "").split()) for text in _TABLES.split(";") if text.strip()}
    for kind, name, text in connection.execute("SELECT type, name, sql FROM sqlite_master").fetchall():
        if kind != "table" or " ".join(str(text).split()) not in expected:
            raise _damaged(f"unexpected {quoted(kind)} {quoted(name)}", path)
        expected.remove(" ".join(str(text).split()))
    if expected:
        raise _damaged("a table is missing", path)
    for (result,) in connection.execute("PRAGMA quick_check(1)"):
        if result != "ok":
            raise _damaged(str(result), path)


@contextmanager
def _usable(path: Path) -> Iterator[None]:
    """Raise SettingError for errors of the database."""
    try:
        yield
    except sqlite3.Error as error:
        raise _error(f"cannot use the store: {_reason(error)}", _OTHER_FILE, path) from error


def _reason(error: sqlite3.Error) -> str:
    return "its content does not end" if str(error) == "interrupted" else encodable(str(error))


def _damaged(what: str, path: Path) -> SettingError:
    return _error(f"the store is damaged: {what}", "restore it, or repeat the sweep with a new file", path)


def _error(message: str, hint: str, path: Path) -> SettingError:
    return SettingError(Diagnostic(message, hint, str(path)))
