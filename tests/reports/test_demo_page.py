"""Page of the demo from synthetic tables and stories."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import eidrive_reports
import numpy as np
import pytest
from eidrive_reports.demo_page import DemoSite, PageImage, _speed, write_demo
from eidrive_reports.key_frames import KeyFrames, Story
from eidrive_reports.paper import (
    ARMS,
    LINKS,
    OWN,
    SCENARIOS,
    TABLE_2,
    VARIANTS,
    Cell,
    ModelVariant,
    Table,
)
from lxml import html

from eidrive_scenario import reporting
from eidrive_scenario.experiments.reported_run import parse_run
from eidrive_scenario.experiments.statistics.intervals import wilson
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing

AREA = np.array([[29.0, 4.5], [32.0, 4.5], [32.0, 10.5], [29.0, 10.5]])


def table(variant: ModelVariant) -> Table:
    cells = []
    for (scenario, detector, name), published in TABLE_2.items():
        if detector != "oracle":
            continue
        arm = next(arm for arm in ARMS if arm.name == name)
        centers = published.episodes
        boxes = tuple(max(0.0, center - 3.4) for center in centers)
        free = sum(box > 0 for box in boxes)
        cells.append(Cell(scenario, arm, (1, 2, 3, 4, 5), centers, boxes, wilson(free, 5), published))
    return Table(variant, tuple(cells))


def story(frames: list[Frame]) -> Story:
    observer = KeyFrames("Ego", "Incoming", [AREA])
    for frame in frames:
        observer.observe(frame)
    return observer.story()


@pytest.fixture(scope="module")
def page(street: Callable[..., list[Frame]], tmp_path_factory: pytest.TempPathFactory) -> str:
    delays = {"none": None, "cooperation": 1, "latency": 6, "error": 2}
    stories = {
        (scenario, arm.channel(variant)): story(street(delays[arm.name]))
        for scenario in SCENARIOS
        for variant in VARIANTS
        for arm in ARMS
    }
    view = PageImage("View of Ego", "a <truck>", b"\x89PNG")
    site = DemoSite(RoadDrawing(lanes=(("driving", AREA),)), (AREA,), (view,))
    out = tmp_path_factory.mktemp("demo") / "reports" / "demo.html"
    run = parse_run(
        {"scenario": "coop/scenario_1", "seed": 1, "channel": "ideal", "passed": True, "end_reason": "stop trigger"}
    )
    write_demo(
        out, [run], table(LINKS), table(OWN), stories, dict.fromkeys(SCENARIOS, site), watched=1, footer="version 1"
    )
    return out.read_text(encoding="utf-8")


def test_styles_of_studies_use_the_colors_of_both_schemes() -> None:
    """`style.css` of the engine defines each variable for a light and a dark scheme."""
    style = (Path(reporting.__file__).parent / "templates" / "style.css").read_text(encoding="utf-8")
    templates = [
        path.read_text(encoding="utf-8") for path in Path(eidrive_reports.__file__).parent.rglob("*.html.jinja")
    ]
    assert len(templates) == 3
    fixed = re.compile(r"(?:color|background|border)[^;:}]*:[^;}]*#[0-9a-f]{3}")
    assert not [color for text in templates for color in fixed.findall(text)]
    used = {name for text in templates for name in re.findall(r"var\((--\w+)", text)}
    assert used <= {*re.findall(r"(--\w+): #", style), "--arm"}


def test_demo_page_has_no_external_resources(page: str) -> None:
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "<link" not in page
    page = page.partition("<script")[0]
    assert all(address.startswith(("#", "data:")) for address in re.findall(r'(?:href|src)="([^"]*)"', page))


def test_demo_page_has_four_figures_or_reasons_per_arm(page: str) -> None:
    root = html.fromstring(page)
    strips = [strip for strip in root.iterfind(".//div[@class='strip']")]
    assert len(strips) == len(SCENARIOS) * len(VARIANTS) * len(ARMS)
    assert all(len(strip.findall("figure")) == 4 for strip in strips)
    empty = [str(figure.xpath("string()")).strip() for figure in strips[0].iterfind("figure[@class='empty']")]
    assert empty == ["Ego never brakes"]


def test_demo_page_captions_state_time_distance_and_speed(page: str) -> None:
    captions = [str(caption.xpath("string()")) for caption in html.fromstring(page).iterfind(".//figcaption")]
    assert any(
        re.fullmatch(r"Ego receives Incoming only from RSUat 1\.45 s, 26\.\d m between centers, .*", c)
        for c in captions
    )


def test_demo_page_tables_contain_published_values(page: str) -> None:
    rows = [
        [" ".join(str(cell.xpath("string()")).split()) for cell in row.iterfind("td")]
        for row in html.fromstring(page).iterfind(".//tbody/tr")
    ]
    assert len([row for row in rows if len(row) == 9]) == len(VARIANTS) * len(SCENARIOS) * len(ARMS)
    assert rows[3] == [
        *("error 30 %", "3.15", "1.07", "1.82", "0.38", "0.00", "3/5", "0.23 … 0.88", "3.15 ± 1.07"),
    ]


def test_demo_page_shows_tables_and_folds_figures(page: str) -> None:
    figures = html.fromstring(page).iterfind(".//figure")
    assert all(next(figure.iterancestors("details"), None) is not None for figure in figures)
    assert not html.fromstring(page).findall(".//details[@open]")


def test_demo_page_explains_the_colors_of_key_frames(page: str) -> None:
    root = html.fromstring(page)
    entries = [str(entry.xpath("string()")) for entry in root.iterfind(".//div[@class='legend']/span")]
    expected = {"conflict area", "received from others", "message delivered", "after fusion", "Ego"}
    assert expected <= set(entries)
    pictures = [picture.get("alt", "") for picture in root.iterfind(".//div[@class='strip']/figure/img")]
    assert any(text.startswith("cooperation: Ego receives Incoming only from RSU at 1.45 s") for text in pictures)


def test_demo_page_contains_checks_difference_and_charts(page: str) -> None:
    root = html.fromstring(page)
    assert len(root.findall(".//li[@class='holds']")) == 12
    assert "Delaying and dropping the ego's own detections" in str(root.xpath("string()"))
    assert len(root.findall(".//svg[@class='chart']")) == 4


def test_demo_page_embeds_images_with_escaped_captions(page: str) -> None:
    assert page.count('"data:image/png;base64,iVBORw=="') == 2
    assert "a &lt;truck&gt;" in page


@pytest.mark.parametrize(
    ("speed", "text"), [(8.0, "at 29 km/h"), (-0.1, "at 0 km/h"), (-1.4, "moving backwards at 5 km/h")]
)
def test_speed_of_backward_motion_has_no_negative_number(speed: float, text: str) -> None:
    assert _speed(speed) == text
