"""Runs and scenarios in notebooks: `eidrive_scenario.api.report`."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import etree

from eidrive_scenario.api import report
from eidrive_scenario.api.common import Scenario
from eidrive_scenario.api.run import RunResult, load_scenario, run_and_save, run_file
from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.extensions.library import library_path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return run_and_save("coop/scenario_1", out=tmp_path_factory.mktemp("run") / "<b>&")


def test_recorded_run_is_shown_with_its_replay(recorded: RunResult) -> None:
    shown = report.show(recorded, height=300)
    verdicts, frame = shown._repr_html_().split("<iframe", 1)
    assert "min_distance" in verdicts
    assert "height:300px" in frame
    page = html.unescape(frame.partition('srcdoc="')[2].rpartition('"')[0])
    assert page.startswith("<!DOCTYPE html>")
    assert page.rstrip().endswith("</html>")
    assert repr(shown) == str(recorded)
    assert recorded.folder is not None
    assert report.show(recorded.folder)._repr_html_().startswith("<iframe")


def test_run_without_recording_is_shown_without_replay() -> None:
    assert "<iframe" not in report.show(run_file("coop/scenario_1"))._repr_html_()


def test_pages_are_those_of_the_command_line(recorded: RunResult, tmp_path: Path) -> None:
    assert recorded.folder is not None
    assert report.write_replay(recorded.folder, tmp_path / "replay.html").stat().st_size > 100_000
    assert report.write_report(recorded.folder, out=tmp_path).name == "report.html"
    with pytest.raises(InputError):
        report.write_replay(tmp_path / "absent", tmp_path / "replay.html")


@pytest.mark.parametrize(
    "source", ["coop/scenario_1", library_path() / "roads" / "coop_1.xodr", load_scenario("coop/scenario_1")]
)
def test_pictures_are_vectors_in_notebooks_and_files(source: str | Path | Scenario, tmp_path: Path) -> None:
    picture = report.draw(source, size=(120, 80))
    assert etree.fromstring(picture._repr_svg_().encode()).tag.endswith("svg")
    picture.write(tmp_path / "picture.pdf")
    assert (tmp_path / "picture.pdf").read_bytes().startswith(b"%PDF")


def test_road_file_has_no_station() -> None:
    with pytest.raises(SettingError, match="a road file has no station"):
        report.draw(library_path() / "roads" / "coop_1.xodr", station="Ego")


@pytest.mark.parametrize(
    ("function", "argument", "options", "message"),
    [
        (report.show, None, {}, "run is None; give the result of a run, its folder or its recording"),
        (report.draw, "coop/scenario_1", {"size": (0, 90)}, "size: no width and height in millimeters (got (0, 90))"),
        (report.draw, "coop/scenario_1", {"size": 85}, "size: no width and height in millimeters (got 85)"),
    ],
)
def test_wrong_argument_is_reported_with_the_expected_one(
    function: Callable[..., object], argument: object, options: dict[str, object], message: str
) -> None:
    with pytest.raises(SettingError, match=re.escape(message)):
        function(argument, **options)
