"""Figures and page of the reproduction, from episodes with the paper's values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eidrive_reports.paper import COUNTS, TABLE_3
from eidrive_reports.reproduction import detection, sensitivity, table_3
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.figures import detection_figure, draw, sensitivity_figure, table_3_figure
from eidrive_reports.reproduction.layout import PartReport
from eidrive_reports.reproduction.page import write_paper_page
from lxml import html
from matplotlib.figure import Figure

from eidrive_scenario.errors import SettingError


def report_of_table_3() -> PartReport:
    """Return the report of 20 episodes a cell, of which as many are free of collisions as in the paper."""
    found = []
    for case in table_3.cases(("oracle",)):
        free = round(20 * TABLE_3[case.scenario, case.arm.split()[1]].rate)
        for seed in range(1, 21):
            values = {"collision.count": float(seed > free), "collision.impact_speed": 5.0}
            values |= {"min_distance.Ego.Incoming.center": 3.0, "min_distance.Ego.Incoming.box": 0.0}
            found.append(Episode(case.scenario, case.arm, seed, "", "", 10.0, 0.5, values))
    return table_3.report(found, ("oracle",))


def report_of_counts() -> PartReport:
    """Return the report of one episode with a constant count of 5 in each cell."""
    metrics = {"detection_count.Ego.mean": 5.0}
    cases = detection.cases(("oracle",))
    found = [Episode(case.scenario, case.arm, 1, "", "", 12.0, 0.5, metrics, counts=(5,) * 400) for case in cases]
    return detection.report(found, ("oracle",))


def points(figure: Figure, panel: int) -> list[list[float]]:
    """Return the ordinates of the lines of a panel."""
    return [list(map(float, line.get_ydata())) for line in figure.axes[panel].get_lines()]  # type: ignore[arg-type]


def test_figure_of_table_3_shows_measured_and_published_rates() -> None:
    """Scenario 5: 20, 19 and 4 of 20 runs without a collision, and the rates of the paper."""
    drawn = points(table_3_figure(report_of_table_3().data()), 0)
    assert [1.0, 0.95, 0.2] in drawn
    assert [TABLE_3["coop/scenario_5", senders].rate for senders in table_3.SENDERS] in drawn


def test_figure_of_counts_shows_averages_and_means_of_the_paper() -> None:
    drawn = points(detection_figure(report_of_counts().data()), 0)
    assert [line for line in drawn if len(line) == 400] == [[5.0] * 400] * 2
    assert {line[0] for line in drawn} == {
        5.0,
        *(COUNTS["coop/scenario_3", "oracle", arm].mean for arm in detection.ARMS),
    }


def test_equal_reports_give_equal_figures_and_parts_without_a_figure_none(tmp_path: Path) -> None:
    report = report_of_table_3()
    first, second = (draw("table3", report, tmp_path / name) for name in ("a", "b"))
    assert first is not None
    assert second is not None
    assert first.read_bytes() == second.read_bytes()
    assert draw("ei", report, tmp_path) is None


def test_page_shows_texts_tables_and_figures_of_all_parts_in_order(tmp_path: Path) -> None:
    for name, report in (("detection", report_of_counts()), ("table3", report_of_table_3())):
        (tmp_path / f"{name}.json").write_text(json.dumps(report.as_json()))
    draw("table3", report_of_table_3(), tmp_path)
    origin = {"commit": "abc", "seeds": "1 to 20", "runs": 240, "last_call_s": 12.5}
    (tmp_path / "provenance.json").write_text(json.dumps({"table3": origin}))
    page: Any = html.fromstring(write_paper_page(tmp_path).read_text(encoding="utf-8"))
    assert page.xpath("//h2/@id") == ["table3", "detection"]
    assert len(page.xpath("//img[starts-with(@src, 'data:image/png')]")) == 1
    text = " ".join(page.text_content().split())
    assert "commit abc, seeds 1 to 20, 240 runs, in 12.5 s" in text
    assert "12 of 12 rates are within 10 points" in text
    rows = [[cell.text_content() for cell in row.findall("td")] for row in page.iter("tr")]
    assert rows[1][:5] == ["coop/scenario_5", "both", "20 of 20 = 100%", "84% to 100%", "100% ± 0%"]
    assert next(code.text_content() for code in page.iter("code")) == "oracle"


def test_page_states_runs_and_duration_of_all_parts(tmp_path: Path) -> None:
    """The sum is stated if each part was computed in a single call."""
    origins = {
        name: {"runs": runs, "runs_of_last_call": runs, "last_call_s": seconds, "processes": 2}
        for name, runs, seconds in (("table2", 1120, 1800.0), ("table3", 480, 420.0))
    }
    (tmp_path / "provenance.json").write_text(json.dumps(origins))
    assert "1,600 runs in 37 minutes on 2 processes." in write_paper_page(tmp_path).read_text()
    origins["table3"]["runs_of_last_call"] = 12
    (tmp_path / "provenance.json").write_text(json.dumps(origins))
    assert "minutes" not in write_paper_page(tmp_path).read_text()


def test_page_of_a_folder_without_parts_lists_none(tmp_path: Path) -> None:
    page: Any = html.fromstring(write_paper_page(tmp_path / "new").read_text(encoding="utf-8"))
    assert page.xpath("//h2") == []


@pytest.mark.parametrize(
    "content", ["{", "[]", '{"title": "a"}', '{"title": "a", "sections": [{"title": "b"}]}', "null"]
)
def test_damaged_report_is_an_error(tmp_path: Path, content: str) -> None:
    (tmp_path / "table3.json").write_text(content)
    with pytest.raises(SettingError, match=r"table3\.json: the file is damaged: .*eidrive reproduce"):
        write_paper_page(tmp_path)


def test_text_of_a_report_is_escaped(tmp_path: Path) -> None:
    section = {"title": "<b>", "paragraphs": ["a < b `<i>`"], "columns": ["<u>"], "rows": [["<s>"]]}
    (tmp_path / "ei.json").write_text(json.dumps({"title": "<h1>", "sections": [section]}))
    text = write_paper_page(tmp_path).read_text(encoding="utf-8")
    assert "a &lt; b <code>&lt;i&gt;</code>" in text
    assert [tag for tag in ("<b>", "<u>", "<s>", "<i>") if tag in text] == []


def test_figure_of_sensitivity_shows_shares_of_collisions() -> None:
    """Without cooperation every run collides, with any messages none: the first map is 1, the others 0."""
    found = []
    for case in sensitivity.cases(("oracle",)):
        hit = float(case.arm.endswith(" none"))
        found.append(Episode(case.scenario, case.arm, 1, "", "", 9.0, 0.3, {"collision.count": hit}))
    figure = sensitivity_figure(sensitivity.report(found, ("oracle",)).data())
    maps = [axes.collections[0].get_array() for axes in figure.axes if "hidden" in axes.get_xlabel()]
    assert [set(np.asarray(values).ravel()) for values in maps] == [{1.0}, *[{0.0}] * 5]
