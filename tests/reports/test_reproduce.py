"""`eidrive reproduce`: tables, continuation of an interrupted call, exit codes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from eidrive_reports.reproduction import figures, table_2
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import PartReport
from eidrive_reports.reproduction.parts import PARTS
from lxml import html

QUICK = ("--detectors", "oracle", "--workers", "1")
"""Options of runs without image processing in the process of the test."""


def files(folder: Path) -> dict[str, bytes]:
    """Return report, tables and figures, without the record and the files that contain durations."""
    written = (path for path in folder.iterdir() if path.suffix in (".md", ".csv", ".json", ".png"))
    return {path.name: path.read_bytes() for path in written if path.name != "provenance.json"}


@pytest.mark.process
@pytest.mark.timeout(300)
def test_table_2_continues_after_a_kill_and_repeats_its_tables(
    eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two episodes a cell with the rule of the paper; the order of the arms is the paper's."""
    monkeypatch.setattr(table_2, "PLANNERS", ("conflict_area",))
    out = tmp_path / "paper"
    arguments = ("reproduce", "table2", "--episodes", 2, *QUICK, "--out", out)
    first = eidrive(*arguments)
    assert (first.exit_code, first.stdout.split(" runs in")[0]) == (0, "table2: 28")
    written = files(out)
    tables = {"table2.csv", "table2_summary.csv", "table2_comparisons.csv"}
    assert set(written) == {"table2.md", "table2.json", "table2.png", *tables}
    summary = json.loads((out / "table2.json").read_bytes())["tables"]["table2_summary"]
    orders = [row for row in summary if row["statement"] in ("cooperation > none", "cooperation > latency")]
    assert [row["holds"] for row in orders] == [2] * len(orders) != []
    origin = json.loads((out / "provenance.json").read_bytes())["table2"]
    assert (origin["seeds"], origin["runs"], origin["runs_of_last_call"]) == ("1 to 2", 28, 28)
    assert (
        (out / "table2.md").read_text().startswith("# Table II: minimum distance to an occluded car\n\n## Question\n")
    )
    repeated = eidrive(*arguments)
    assert repeated.stdout.startswith("table2: 0 runs in")
    assert json.loads((out / "provenance.json").read_bytes())["table2"] == origin
    assert files(out) == written

    record = out / "table2.jsonl"
    lines = record.read_bytes().splitlines(keepends=True)
    record.write_bytes(b"".join(lines[:-2]) + lines[-2][:40])
    second = eidrive(*arguments)
    assert second.stdout.startswith("table2: 2 runs in")
    assert "26 from the record" in second.stdout
    assert files(out) == written
    assert len(record.read_bytes().splitlines()) == 28

    fewer = eidrive("reproduce", "table2", "--episodes", 1, *QUICK, "--out", out)
    assert fewer.stdout.startswith("table2: 0 runs in")
    assert "14 runs of the record have other settings, seeds or code" in fewer.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("tabel2",), "part: unknown name 'tabel2'; did you mean 'table2'?"),
        (("benchmarks",), "part: unknown name 'benchmarks'; did you mean 'benchmark'?"),
        (("table2", "--detectors", "yolov6"), "--detectors: unknown name 'yolov6'"),
        (("table2", "--detectors", "oracle,"), "--detectors: unknown name ''"),
        (("table2", "--detectors", "ssd"), "--detectors: part table2 uses none of them (got 'ssd'); known: oracle"),
        (("all", "table2", "--detectors", "ssd"), "--detectors: part table2 uses none of them"),
        (("table2", "--episodes", "1000000000"), "less than or equal to 10000"),
        (("table2", "--episodes", "0"), "greater than or equal to 1"),
        (("table2", "--episodes", "many"), "should be a valid integer"),
        (("table2", "--workers", "0"), "greater than or equal to 1"),
        (("table2", "--retsart"), "No such option"),
    ],
)
def test_invalid_arguments_end_with_exit_code_2(
    eidrive: Eidrive, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    result = eidrive("reproduce", *arguments, "--out", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
    assert not (tmp_path / "out").exists()


def test_unwritable_folder_ends_with_exit_code_2(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("text")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        result = eidrive("reproduce", "table2", *QUICK, "--out", out)
        assert (result.exit_code, "cannot write" in result.stderr) == (2, True)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("table3.jsonl", b'{"scenario": "coop/scenario_5"}\n', "table3.jsonl:1: the record is damaged"),
        ("provenance.json", b"[1]", "provenance.json: the file is damaged: not a JSON object; remove it"),
        ("provenance.json", b"{", "provenance.json: the file is damaged"),
        ("provenance.json", b'{"table2": 1}', "provenance.json: the file is damaged"),
    ],
)
def test_damaged_file_ends_with_exit_code_2_before_the_runs(
    eidrive: Eidrive, tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    result = eidrive("reproduce", "table3", *QUICK, "--out", tmp_path)
    assert (result.exit_code, message in result.stderr) == (2, True)
    assert (tmp_path / name).read_bytes() == content


def test_help_names_all_parts(eidrive: Eidrive) -> None:
    text = eidrive("reproduce", "--help").stdout
    assert [name for name in PARTS if name not in text] == []


def test_hyphen_is_no_folder(eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = eidrive("reproduce", "table2", "--episodes", 1, *QUICK, "--out", "-")
    assert (done.exit_code, "--out: - is not a path" in done.stderr) == (2, True)
    assert not list(tmp_path.iterdir())


def test_replays_are_linked_from_the_page(eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page links to the report of the recorded runs, which links to a replay of each."""
    part = replace(PARTS["table2"], cases=lambda detectors: table_2.cases(detectors)[:2], report=empty_report)
    monkeypatch.setitem(PARTS, "table2", part)
    monkeypatch.setattr(figures, "draw", lambda *_: None)
    done = eidrive("reproduce", "table2", "--episodes", 1, *QUICK, "--out", tmp_path, "--replays")
    assert done.exit_code == 0, done.stderr
    (address,) = html.parse(tmp_path / "index.html").xpath("//a[contains(@href, 'replays_table2')]/@href")
    report = tmp_path / address
    links = html.parse(report).xpath("//a[starts-with(@href, 'replays/')]/@href")
    assert len(set(links)) == 2
    assert all((report.parent / link).is_file() for link in links)


def empty_report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    return PartReport("Two runs", ())
