"""Demo with one seed, end to end."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from eidrive_reports.demo import demo, main
from eidrive_reports.paper import SCENARIOS, evaluate_claims, run_settings
from lxml import html
from report_table import listed_runs
from rich.console import Console


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, tuple[bool, ...]]:
    out = tmp_path_factory.mktemp("demo") / "demo.html"
    printed = io.StringIO()
    tables = demo(out, range(1, 2), 1, Console(file=printed, width=80))
    return out, printed.getvalue(), tuple(check.holds for table in tables for check in evaluate_claims(table)[:2])


@pytest.mark.exhaustive
def test_demo_confirms_order_of_cooperation_none_and_latency(
    done: tuple[Path, str, tuple[bool, ...]],
) -> None:
    assert all(done[2])


def test_demo_prints_both_tables_and_difference(done: tuple[Path, str, tuple[bool, ...]]) -> None:
    text = done[1]
    assert text.count("Table II") == 2
    assert text.count("no cooperation ") >= 4
    assert "Delaying and dropping the ego's own detections" in text
    assert "14/14" in text


def test_demo_writes_every_run_as_json(done: tuple[Path, str, tuple[bool, ...]]) -> None:
    runs = json.loads(done[0].with_suffix(".json").read_text(encoding="utf-8"))
    assert {(run["scenario"], run["channel"]) for run in runs} == {(s, c) for s in SCENARIOS for c in run_settings()}
    assert all(len(run["trace_hash"]) >= 16 for run in runs)


def test_demo_page_contains_camera_images_of_ego_and_helper(done: tuple[Path, str, tuple[bool, ...]]) -> None:
    page = done[0].read_text(encoding="utf-8")
    assert len(html.fromstring(page).findall(".//div[@class='strip two']/figure/img")) == 4
    assert "View of RSU" in page
    assert "View of Spectator" in page


def test_demo_page_ends_in_the_report_with_replays(done: tuple[Path, str, tuple[bool, ...]]) -> None:
    page: Any = html.parse(str(done[0])).getroot()
    assert page.find_class("lead")[1].text_content().startswith("14 runs: ")
    runs = listed_runs(done[0])
    assert len(runs) == len(SCENARIOS) * len(run_settings())
    assert all(run["replay"] and (done[0].parent / run["replay"]).is_file() for run in runs)
    (matrix,) = page.find_class("matrix")
    assert [str(cell.text_content()) for cell in matrix.iterfind("tbody/tr/th")] == list(SCENARIOS)
    commands = [set(run["command"].split()) for run in runs]
    assert {"eidrive", "run", "coop/scenario_1", "--detector", "oracle", "--channel", "none", "--seed", "1"} in commands


@pytest.mark.parametrize("arguments", [["--seeds", "0"], ["--workers", "0"], ["--sedes", "3"], ["--out", "demo.json"]])
def test_main_with_invalid_arguments_ends_with_exit_code_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert "error:" in capsys.readouterr().err
