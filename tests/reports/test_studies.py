"""Tables, options and errors of the studies."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from eidrive_reports.studies import markdown_table, publish

STUDIES = ("closed_loop", "corner_cases", "demo", "driven_corpora", "heat_maps", "overtaking", "planner_scenes")
SEEDED = ("closed_loop", "corner_cases", "overtaking", "planner_scenes")


def test_table_has_header_rule_and_one_line_per_row() -> None:
    assert markdown_table(("name", "count"), [("a", 1), ("b", 2)]) == (
        "| name | count |\n|---|---|\n| a | 1 |\n| b | 2 |\n"
    )
    assert markdown_table(("name",), []) == "| name |\n|---|\n"


def test_result_is_written_to_file_and_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    publish("| ² |\n", tmp_path / "out" / "table.md")
    assert (tmp_path / "out" / "table.md").read_text(encoding="utf-8") == capsys.readouterr().out == "| ² |\n"


@pytest.mark.parametrize(
    ("study", "option"),
    [*((study, "--workers") for study in STUDIES), *((study, "--seeds") for study in ("demo", *SEEDED))],
)
def test_numbers_of_processes_and_seeds_of_each_study_are_positive(
    study: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        importlib.import_module(f"eidrive_reports.{study}").main([option, "0"])
    assert ended.value.code == 2
    assert f"argument {option}: not a positive number (got 0)" in capsys.readouterr().err
    assert not any(tmp_path.iterdir()), "an invalid call writes nothing"


@pytest.mark.parametrize("study", SEEDED)
def test_error_of_an_output_is_a_message_and_exit_code_2(
    study: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The name of the table is that of a folder. No run is made."""
    (tmp_path / f"{study}.md").mkdir()
    module = importlib.import_module(f"eidrive_reports.{study}")
    monkeypatch.setattr(module, "run_jobs", lambda *jobs, **options: [])
    few = ["--seeds", "1", *(["--drives", "0"] if study == "overtaking" else [])]
    assert module.main(["--out", str(tmp_path), *few]) == 2
    assert f"{study}.md: cannot write" in capsys.readouterr().err


@pytest.mark.parametrize(("study", "suffix"), [("long_drives", "xodr"), ("heat_maps", "xosc")])
def test_files_of_one_name_in_two_folders_are_an_error(
    study: str, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The results of the second one would replace those of the first."""
    names = [str(tmp_path / folder / f"x.{suffix}") for folder in "ab"]
    with pytest.raises(SystemExit):
        importlib.import_module(f"eidrive_reports.{study}").main([*names, "--out", str(tmp_path)])
    assert "two files have the name x" in capsys.readouterr().err


def test_overtaking_creates_the_folder_of_its_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("eidrive_reports.overtaking")
    monkeypatch.setattr(module, "run_jobs", lambda *jobs, **options: [])
    figures = tmp_path / "new" / "figures"
    options = ["--seeds", "1", "--drives", "0", "--out", str(tmp_path), "--figures", str(figures)]
    assert module.main(options) == 0
    assert (figures / "overtaking.png").read_bytes()[1:4] == b"PNG"
    assert (tmp_path / "overtaking.md").is_file()
