"""Commands that draw figures: output files, and errors of paths and names."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import typer
from eidrive_reports import trends, weather_sheet
from matplotlib.figure import Figure


def test_weather_sheet_has_one_row_per_weather(tmp_path: Path) -> None:
    out = tmp_path / "new" / "sheet.png"
    weather_sheet.write(out, ["storm", "sunny"])
    image = cv2.imread(str(out))
    assert image is not None
    assert image.shape == (2 * (360 + 30), 2 * 640, 3)


def test_weather_sheet_caption_does_not_overlap_title() -> None:
    bare = np.zeros((4, 640, 3), dtype=np.uint8)
    title = weather_sheet._add_caption(bare, "storm: car", "")
    both = weather_sheet._add_caption(bare, "storm: car", "visual range 4000 m, " * 6)
    end = int(np.flatnonzero((title[:30, :600] < 200).any(axis=(0, 2)))[-1])
    dark = np.flatnonzero((both[:30] < 200).any(axis=(0, 2)))
    assert not ((dark > end) & (dark <= end + 12)).any()


@pytest.mark.parametrize("weather", [["sunnny"], ["sunny"]])
def test_weather_sheet_of_invalid_name_or_path_ends_with_exit_code_2(
    tmp_path: Path, weather: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended:
        weather_sheet.write(tmp_path, weather)
    assert ended.value.exit_code == 2
    assert ("did you mean 'sunny'?" if weather == ["sunnny"] else "Is a directory") in capsys.readouterr().err


def test_trends_writes_figures_or_reports_unwritable_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(trends, "FIGURES", {"empty": Figure})
    assert trends.main(["--out", str(tmp_path / "new")]) == 0
    assert (tmp_path / "new" / "empty.png").read_bytes()[1:4] == b"PNG"
    (tmp_path / "file").write_text("")
    assert trends.main(["--out", str(tmp_path / "file")]) == 2
    assert "cannot write: File exists" in capsys.readouterr().err
