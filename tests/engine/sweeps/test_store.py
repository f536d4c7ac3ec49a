"""Stores of sweeps: rows, versions, locks, damaged files, full disks."""

from __future__ import annotations

import sqlite3
import zlib
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from sweep_runs import RUN, VERSIONS, opened

from eidrive_scenario.errors import Diagnostic, EidriveError, SettingError, SimulationError
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun

UNREADABLE = r"the store is damaged|cannot use the store"


def test_store_returns_added_runs_in_order(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "s.db"
    with opened(path) as store:
        store.add(RUN)
        store.add(replace(RUN, key="b" * 64, number=1, status="aborted", result={}, error="no\nway", settings=""))
        assert store.statuses() == {"a" * 64: "passed", "b" * 64: "aborted"}
    with ResultStore.read(path) as store:
        first, second = store.runs()
        assert (first.number, first.error) == (1, "no\nway")
        assert second == RUN
        assert store.versions == VERSIONS


def test_add_with_same_key_replaces_row(tmp_path: Path) -> None:
    with opened(tmp_path / "s.db") as store:
        store.add(replace(RUN, status="crashed"))
        store.add(RUN)
        assert list(store.runs()) == [RUN]


def test_add_escapes_bytes_that_are_not_utf_8(tmp_path: Path) -> None:
    """Messages about files whose names are not UTF-8 have lone surrogates."""
    with opened(tmp_path / "s.db") as store:
        store.add(replace(RUN, error="no file 'a\udcff'", command="eidrive run 'a\udcff'", settings='{"a": "\udcff"}'))
        (run,) = store.runs()
    assert (run.error, run.command, run.settings) == (
        r"no file 'a\udcff'",
        r"eidrive run 'a\udcff'",
        r'{"a": "\udcff"}',
    )


def test_open_of_store_of_other_versions_raises(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(RUN)
    with (
        pytest.raises(SettingError, match=r"eidrive-scenario 1.0 \(now 2.0\)"),
        opened(path, **{"eidrive-scenario": "2.0"}),
    ):
        pass
    with opened(path) as store:
        assert len(store.statuses()) == 1


def add_and_raise(path: Path) -> None:
    with opened(path) as store:
        store.add(RUN)
        raise SettingError(Diagnostic("no axes"))


@pytest.mark.parametrize("error", [SettingError(Diagnostic("no axes")), SimulationError("no worker")])
def test_error_deletes_new_store_without_runs(tmp_path: Path, error: EidriveError) -> None:
    path = tmp_path / "s.db"
    with pytest.raises(type(error)), opened(path):
        raise error
    assert not path.exists()


def test_error_keeps_new_store_with_runs(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with pytest.raises(SettingError, match="no axes"):
        add_and_raise(path)
    with ResultStore.read(path) as store:
        assert list(store.runs()) == [RUN]


def test_error_keeps_existing_store_without_runs(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path):
        pass
    with pytest.raises(SettingError, match="no axes"), opened(path):
        raise SettingError(Diagnostic("no axes"))
    assert path.exists()


def test_open_of_other_format_raises(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path):
        pass
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version=99")
    connection.close()
    with pytest.raises(SettingError, match="format 99"), opened(path):
        pass
    with pytest.raises(SettingError, match="format 99"), ResultStore.read(path):
        pass


def test_open_of_other_files_raises_and_keeps_them(tmp_path: Path) -> None:
    other = tmp_path / "other.db"
    with sqlite3.connect(other) as connection:
        connection.execute("CREATE TABLE mine (x)")
    connection.close()
    text = tmp_path / "notes.txt"
    text.write_text("not a database, but long enough to have a header" * 10)
    for path in (other, text):
        before = path.read_bytes()
        with (
            pytest.raises(
                SettingError, match=r"(not a store|cannot use the store).*; give a file of `eidrive sweep --store`"
            ),
            opened(path),
        ):
            pass
        assert path.read_bytes() == before


def test_new_store_has_all_its_tables_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process finds no file, an empty one, or a complete store, also if the creating one is killed."""
    path, seen, connect = tmp_path / "s.db", set(), sqlite3.connect

    def traced(*arguments: Any, **options: Any) -> sqlite3.Connection:
        connection: sqlite3.Connection = connect(*arguments, **options)
        connection.set_trace_callback(look)
        return connection

    def look(statement: str) -> None:
        with closing(connect(path)) as other:
            seen.add(
                frozenset(name for (name,) in other.execute("SELECT name FROM sqlite_master WHERE type = 'table'"))
            )

    monkeypatch.setattr(sqlite3, "connect", traced)
    with opened(path) as store:
        assert store.statuses() == {}
    assert seen == {frozenset(), frozenset({"meta", "runs"})}


def test_two_writers_of_one_store_raise(tmp_path: Path) -> None:
    """The second one is refused; a reader is not."""
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(RUN)
        with pytest.raises(SettingError, match="another"), opened(path):
            pass
        with ResultStore.read(path) as reader:
            assert list(reader.runs()) == [RUN]


@pytest.mark.parametrize("kind", ["folder", "missing", "file below a file"])
def test_unusable_paths_raise(tmp_path: Path, kind: str) -> None:
    (tmp_path / "file").write_text("")
    path = {"folder": tmp_path, "missing": tmp_path / "no.db", "file below a file": tmp_path / "file" / "s.db"}[kind]
    if kind == "missing":
        with pytest.raises(SettingError, match="no such store"), ResultStore.read(path):
            pass
    else:
        with pytest.raises(SettingError, match="cannot"), opened(path):
            pass


def test_full_disk_raises_and_keeps_earlier_rows(tmp_path: Path) -> None:
    """SQLite's limit of the number of pages has the error of a full disk."""
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(RUN)
        pages = store._connection.execute("PRAGMA page_count").fetchone()[0]
        store._connection.execute(f"PRAGMA max_page_count={pages}")
        long = replace(RUN, key="b" * 64, error="x" * 500_000)
        with pytest.raises(SimulationError, match=r"full; the results of all earlier runs are stored"):
            store.add(long)
    with ResultStore.read(path) as store:
        assert RUN in list(store.runs())


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("result", '{"a": 1', "result: Expecting"),
        ("result", '{"a": [1]}', "result: Expected"),
        ("result", b"\xff", "UTF-8"),
        ("point", '{"a": {}}', "point: Expected"),
        ("settings", b"no zlib", "decompressing"),
        ("settings", zlib.compress(b"{}")[:-1], "incomplete"),
        ("settings", zlib.compress(b"{"), "Expecting"),
        ("settings", zlib.compress(b"[1]"), "settings: not an object"),
        ("status", "unknown", "unknown status 'unknown'"),
        ("seed", "one", "$.seed"),
    ],
)
def test_damaged_row_raises(tmp_path: Path, column: str, value: str | bytes, reason: str) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(*numbered_runs(3))
    with sqlite3.connect(path) as connection:
        text = "CAST(? AS TEXT)" if value == b"\xff" else "?"
        connection.execute(f"UPDATE runs SET {column} = {text} WHERE number = 1", (value,))
    connection.close()
    with ResultStore.read(path) as store, pytest.raises(SettingError, match="the store is damaged") as raised:
        list(store.runs())
    assert reason in str(raised.value)
    assert str(path) in str(raised.value)


def test_statuses_of_store_with_damaged_row_raise(tmp_path: Path) -> None:
    """A sweep that continues needs only the statuses, but its results could not be read afterwards."""
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(*numbered_runs(3))
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE runs SET result = ? WHERE number = 1", ("[" * 100_000,))
    with opened(path) as store, pytest.raises(SettingError, match="the store is damaged: the row of run 1"):
        store.statuses()


def test_settings_that_expand_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """65 MiB of blanks take 65 kB compressed; one run may have 64 MiB, and the four of a small file 3 MiB here."""
    path = tmp_path / "s.db"
    large = zlib.compress(b"{" + b" " * (65 * 2**20) + b"}")
    for content, limit in ((large, "64 MiB"), (zlib.compress(b"{" + b" " * 2**20 + b"}"), "0 MiB")):
        path.unlink(missing_ok=True)
        with opened(path) as store:
            store.add(*numbered_runs(4))
        with closing(sqlite3.connect(path)) as connection, connection:
            connection.execute("UPDATE runs SET settings = ?", (content,))
        with ResultStore.read(path) as store, pytest.raises(SettingError, match=f"settings: larger than {limit}"):
            list(store.runs())
        monkeypatch.setattr("eidrive_scenario.experiments.sweeps.store._SMALL_SETTINGS", 3 * 2**20)


ENDLESS = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x AS key FROM n"


@pytest.mark.parametrize(
    "change",
    [
        f"DROP TABLE runs; CREATE VIEW runs AS {ENDLESS}",
        f"DROP TABLE meta; CREATE VIEW meta AS {ENDLESS}",
        "CREATE TRIGGER t BEFORE INSERT ON runs BEGIN DELETE FROM runs; END",
        "ALTER TABLE runs ADD COLUMN more AS (zeroblob(1000000000))",
        "DROP TABLE runs",
    ],
)
def test_store_with_other_tables_raises(tmp_path: Path, change: str) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(RUN)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(change)
    with pytest.raises(SettingError, match=UNREADABLE), ResultStore.read(path):
        pass
    with pytest.raises(SettingError, match=UNREADABLE), opened(path):
        pass


def test_statement_that_does_not_end_is_interrupted(tmp_path: Path) -> None:
    with opened(tmp_path / "s.db") as store, pytest.raises(SettingError, match="its content does not end"):
        list(store._select(f"SELECT count(*) FROM ({ENDLESS})"))


def test_damaged_versions_raise(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(RUN)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE meta SET value = '99'")
    connection.close()
    with pytest.raises(SettingError, match="the store is damaged: the versions are invalid"), opened(path):
        pass
    with ResultStore.read(path) as store:
        assert list(store.runs()) == [RUN]


def test_store_with_overwritten_pages_raises(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(*numbered_runs(200))
    content = path.read_bytes()
    path.write_bytes(content[:4096] + b"\x5a" * (len(content) - 4096))
    with (
        pytest.raises(SettingError, match=UNREADABLE),
        ResultStore.read(path) as store,
    ):
        list(store.runs())
    with pytest.raises(SettingError, match=UNREADABLE), opened(path) as store:
        store.statuses()


def numbered_runs(count: int) -> list[StoredRun]:
    return [replace(RUN, key=f"{number:064d}", number=number) for number in range(count)]
