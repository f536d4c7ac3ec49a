"""Pictures for papers: SVG, PDF and PNG of a section of the world."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure

from eidrive_scenario.errors import SettingError
from eidrive_scenario.reporting.drawing.canvas import Canvas
from eidrive_scenario.reporting.drawing.road_labels import round_length
from eidrive_scenario.reporting.drawing.top_view import Window
from eidrive_scenario.reporting.drawing.vector_canvas import (
    VectorCanvas,
    check_format,
    parse_size,
    scene_figure,
    write_figure,
)

SVG = "{http://www.w3.org/2000/svg}"
CAR = (0.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0)


def scene(name: str = "Ego", size: tuple[float, float] = (85.0, 60.0), extent: float = 100.0) -> Figure:
    def draw(canvas: Canvas) -> None:
        canvas.line([(-20.0, 0.0), (20.0, 0.0)], "#0f9d58", 0.4, legend="planned path")
        canvas.body(CAR, "#0f172a", legend="station")
        canvas.label(name, 5.0, 20.0)

    return scene_figure(draw, lambda ratio: Window.centered((0.0, 0.0), extent, ratio), size)


def texts(path: Path) -> list[str]:
    return [element.text or "" for element in ElementTree.parse(path).iter(f"{SVG}text")]


def test_texts_of_svg_remain_texts(tmp_path: Path) -> None:
    name = "Fähre 漢字 <script>alert(1)</script> $x_1$\x07"
    write_figure(scene(name), tmp_path / "a.svg")
    written = texts(tmp_path / "a.svg")
    assert written[-2:] == ["planned path", "station"]
    assert "Fähre 漢字 <script>alert(1)</script> $x_1$?" in written
    assert {"x", "y", "20 m"} <= set(written)


@pytest.mark.parametrize("suffix", [".svg", ".pdf", ".png"])
def test_equal_figures_are_equal_files(tmp_path: Path, suffix: str) -> None:
    for name in ("a", "b"):
        write_figure(scene(), tmp_path / f"{name}{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_size_is_in_millimeters(tmp_path: Path) -> None:
    """85 x 60 mm are 240.94 x 170.08 pt, and 680 x 480 pixels at 8 per millimeter."""
    write_figure(scene(), tmp_path / "a.svg")
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert float(root.attrib["width"].removesuffix("pt")) == pytest.approx(85.0 / 25.4 * 72.0)
    assert float(root.attrib["height"].removesuffix("pt")) == pytest.approx(60.0 / 25.4 * 72.0)
    write_figure(scene(), tmp_path / "a.png")
    picture = cv2.imread(str(tmp_path / "a.png"))
    assert picture is not None
    assert picture.shape == (480, 680, 3)


def test_pdf_contains_truetype_fonts(tmp_path: Path) -> None:
    """Type 42 fonts, whose texts can be searched and edited, instead of outlines of type 3; and no date."""
    write_figure(scene(), tmp_path / "a.pdf")
    content = (tmp_path / "a.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert b"/CIDFontType2" in content
    assert b"/Type3" not in content
    assert b"Date" not in content


def test_fonts_are_those_of_matplotlibrc(tmp_path: Path) -> None:
    with rc_context({"font.family": "serif"}):
        write_figure(scene(), tmp_path / "a.svg")
    assert "serif" in (tmp_path / "a.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize(("extent", "bar"), [(100.0, "20 m"), (39.0, "5 m"), (9000.0, "2000 m")])
def test_scale_bar_is_a_round_length_up_to_a_quarter(tmp_path: Path, extent: float, bar: str) -> None:
    write_figure(scene(extent=extent), tmp_path / "a.svg")
    assert bar in texts(tmp_path / "a.svg")


def test_scale_bar_has_the_length_of_its_text() -> None:
    """20 m of 100 m are a fifth of the width of the axes."""
    (axes,) = scene().axes
    bar = axes.lines[0].get_xdata()
    assert float(np.ptp(np.asarray(bar))) == pytest.approx(20.0)
    assert axes.get_xlim() == (-50.0, 50.0)


def test_section_has_the_same_scale_in_both_directions() -> None:
    figure = scene()
    (axes,) = figure.axes
    width, height = figure.get_size_inches() * axes.get_position().size
    assert np.ptp(axes.get_xlim()) / width == pytest.approx(np.ptp(axes.get_ylim()) / height)


def test_labels_stay_inside_of_their_measured_size() -> None:
    figure = Figure(figsize=(4.0, 3.0), dpi=72.0)
    canvas = VectorCanvas(figure, figure.add_axes((0.0, 0.0, 1.0, 1.0)), Window(0.0, 40.0, 0.0, 30.0))
    narrow, wide = canvas.label_size("ll"), canvas.label_size("WWWW")
    assert 0.0 < narrow[0] < wide[0] < canvas.size[0]
    assert canvas.label_size("ll", 2.0)[0] == pytest.approx(2.0 * narrow[0], rel=0.1)


def test_picture_without_space_for_its_legend_is_refused() -> None:
    def draw(canvas: Canvas) -> None:
        for number in range(30):
            canvas.line([(0, 0), (1, 0)], "#000000", 0.1, legend=f"entry {number}")

    with pytest.raises(SettingError, match=r"too small for the legend.*a height of at least"):
        scene_figure(draw, lambda ratio: Window.centered((0.0, 0.0), 10.0, ratio), (40.0, 30.0))


@pytest.mark.parametrize("text", ["85", "85x", "axb", "10x60", "85x60x1", "nanx60", "85x9999"])
def test_invalid_size_is_refused(text: str) -> None:
    with pytest.raises(SettingError, match="no width and height in millimeters"):
        parse_size(text)


def test_size_may_have_its_unit() -> None:
    assert parse_size("85x60") == parse_size("85X60 mm") == (85.0, 60.0)
    assert parse_size(None) == (160.0, 90.0)


def test_unknown_format_is_refused() -> None:
    check_format("--out", Path("a.PDF"))
    with pytest.raises(SettingError, match=r"--png: unknown format \(got 'a.pdf'\)"):
        check_format("--png", Path("a.pdf"), (".png",))


@pytest.mark.parametrize(("length", "rounded"), [(1.0, 1.0), (1.2, 2.0), (3.0, 5.0), (7.0, 10.0), (0.3, 0.5)])
def test_marks_have_round_distances(length: float, rounded: float) -> None:
    assert round_length(length) == pytest.approx(rounded)
