"""Standard output that is closed, full, or has an encoding without some characters."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest
from msgspec.structs import replace
from rich.table import Table
from rich.text import Text
from sweep_runs import RUN, opened

from eidrive_scenario import cli
from eidrive_scenario.cli.console import console
from eidrive_scenario.cli.output import echo
from eidrive_scenario.files.encodable import printable

FULL = Path("/dev/full")


def eidrive(
    *arguments: str | Path, stdout: int | IO[bytes] = subprocess.PIPE, **variables: str
) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "eidrive_scenario", *map(str, arguments)]
    # In a shell, Python writes what it has buffered at its end, too.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"} | variables
    return subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, env=environment, check=False)


@pytest.mark.process
def test_characters_missing_in_encoding_are_escaped(passing_by: Path) -> None:
    log = eidrive("run", passing_by, "--no-record", "--log", "-", PYTHONIOENCODING="ascii")
    assert log.returncode == 0, log.stderr
    assert rb"simulation time 3.00 s \u2265 3 s" in log.stdout
    assert eidrive("tree", passing_by, PYTHONIOENCODING="latin-1").returncode == 0


@pytest.mark.process
def test_json_output_is_valid_in_any_encoding(passing_by: Path, tmp_path: Path) -> None:
    folder = tmp_path / "späß"
    folder.mkdir()
    copy = folder / "größe ≥ 3.xosc"
    copy.write_bytes(passing_by.read_bytes())
    for encoding in ("latin-1", "utf-8"):
        printed = eidrive("run", copy, "--json", "--no-record", PYTHONIOENCODING=encoding)
        assert json.loads(printed.stdout.decode(encoding))["scenario"] == copy.stem


@pytest.mark.process
def test_table_on_standard_output_continues_the_file_behind_it(passing_by: Path, tmp_path: Path) -> None:
    assert eidrive("run", passing_by, "--out", tmp_path / "run").returncode == 0
    table, standard_output = tmp_path / "table.csv", tmp_path / "output"
    assert eidrive("export", tmp_path / "run", "--csv", table).stdout.decode() == f"{table}\n"
    standard_output.write_bytes(b"former line\n")
    with standard_output.open("ab") as stream:
        exported = eidrive("export", tmp_path / "run", "--csv", "/dev/stdout", stdout=stream)
    assert (exported.returncode, exported.stderr) == (0, b"/dev/stdout\n")
    assert standard_output.read_bytes() == b"former line\n" + table.read_bytes()


CONTROL = "a\x1b]0;x\x07\x9b31m\u202eb\x7f"
ESCAPED = r"a\u001b]0;x\u0007\u009b31m\u202eb\u007f"


def test_control_characters_in_messages_are_escaped(capsys: pytest.CaptureFixture[str]) -> None:
    echo(f"{CONTROL}\n\tsecond line")
    assert capsys.readouterr().out == f"{ESCAPED}\n\tsecond line\n"


def test_control_characters_and_markup_in_tables_are_escaped(capsys: pytest.CaptureFixture[str]) -> None:
    """The console of a terminal adds its own sequences for styles. rich removes the bell."""
    out = console()
    out._force_terminal = True
    table = Table(box=None)
    table.add_row(f"[red]{CONTROL}[/blue]")
    out.print(table, Text("bold", style="bold"), soft_wrap=True)
    text = capsys.readouterr().out
    assert rf"[red]{ESCAPED}[/blue]".replace(r"\u0007", "") in text
    assert not set("\x07\x9b\u202e\x7f") & set(text)


def test_json_with_escaped_control_characters_has_the_same_values() -> None:
    assert json.loads(printable(json.dumps({CONTROL: CONTROL}, ensure_ascii=False))) == {CONTROL: CONTROL}


def test_commands_print_by_functions_that_escape_control_characters() -> None:
    sources = {path.name: path.read_text(encoding="utf-8") for path in Path(cli.__file__).parent.glob("*.py")}
    direct = {name for name, text in sources.items() if re.search(r"typer\.s?echo\(|\bprint\((?<!\.print\()", text)}
    assert direct == {"output.py", "options.py"}


@pytest.mark.process
def test_control_characters_of_a_store_are_escaped(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    with opened(path) as store:
        store.add(replace(RUN, status="aborted", error=CONTROL, command=CONTROL, point={"Speed": CONTROL}))
    for options in (["--failures"], []):
        printed = eidrive("results", path, *options)
        assert printed.returncode == 0
        assert not set("\x1b\x07\x9b\u202e\x7f") & set(printed.stdout.decode())


@pytest.mark.process
def test_control_characters_of_a_scenario_are_escaped(passing_by: Path, tmp_path: Path) -> None:
    """XML 1.0 permits C1, but not C0."""
    copy = tmp_path / "c1.xosc"
    copy.write_text(passing_by.read_text(encoding="utf-8").replace("Ego", "E\x9b31m\u202e"), encoding="utf-8")
    printed = eidrive("tree", copy)
    text = (printed.stdout + printed.stderr).decode()
    assert r"E\u009b31m\u202e" in text
    assert not set("\x9b\u202e") & set(text)


@pytest.mark.process
def test_newline_in_a_file_name_is_escaped(tmp_path: Path) -> None:
    broken = tmp_path / "a\nb.xosc"
    broken.write_text("<no/>", encoding="utf-8")
    for command in ("run", "check", "view"):
        printed = eidrive(command, broken)
        text = (printed.stdout + printed.stderr).decode()
        assert r"a\u000ab.xosc" in text
        assert "\nb.xosc" not in text


def test_file_name_with_undecodable_bytes_is_invalid_input(passing_by: Path, tmp_path: Path) -> None:
    copy = Path(os.fsdecode(os.fsencode(tmp_path) + b"/b\xffd.xosc"))
    try:
        copy.write_bytes(passing_by.read_bytes())
    except OSError:
        pytest.skip("this file system takes no such name")
    result = eidrive("run", copy, PYTHONUTF8="1")
    assert result.returncode == 2
    message = rb"b\xffd.xosc: the name has bytes that are not valid in the encoding of the locale; rename it"
    assert message in result.stderr


@pytest.mark.process
@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("arguments", [["--help"], ["run", "FILE"], ["run", "FILE", "--csv", str(FULL)]])
def test_full_disk_is_reported_in_one_line(passing_by: Path, arguments: list[str]) -> None:
    given = [str(passing_by) if argument == "FILE" else argument for argument in arguments]
    with FULL.open("wb") as full:
        result = eidrive(*given, stdout=full)
    assert result.returncode == 3
    message, *reproduction = result.stderr.decode().splitlines()
    assert message.startswith("aborted: No space left on device")
    assert all(line.startswith("reproduce: eidrive run ") for line in reproduction)
    assert b"internal error" not in result.stderr
    assert b"Traceback" not in result.stderr


@pytest.mark.process
@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_full_standard_error_is_no_failed_criterion(unbuffered: str) -> None:
    """An exception without a handler would end with the exit code 1, and buffered errors with 120."""
    with FULL.open("wb") as full:
        command = [sys.executable, "-m", "eidrive_scenario", "judge", "missing"]
        given = os.environ | {"PYTHONUNBUFFERED": unbuffered}
        assert subprocess.run(command, stderr=full, env=given, check=False).returncode == 3


@pytest.mark.process
@pytest.mark.parametrize("arguments", [["run", "FILE", "--json"], ["tree", "FILE"]])
def test_closed_standard_output_is_not_an_error(passing_by: Path, arguments: list[str]) -> None:
    given = " ".join(f"'{passing_by}'" if argument == "FILE" else argument for argument in arguments)
    closed = f"'{sys.executable}' -m eidrive_scenario {given} >&-"
    result = subprocess.run(["/bin/sh", "-c", closed], capture_output=True, check=False)
    assert (result.returncode, result.stderr) == (0, b"")


@pytest.mark.process
@pytest.mark.parametrize("arguments", [["--version"], ["run", "--help"], ["list", "criteria"]])
def test_reader_that_closes_the_pipe_is_not_an_error(arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    result = eidrive(*arguments, stdout=writer)
    os.close(writer)
    assert result.returncode == 141, "128 + SIGPIPE"
    assert result.stderr == b""
