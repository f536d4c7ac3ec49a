"""Pictures of the library's scenarios and their page."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from eidrive_reports.library_pictures import (
    EGO_COLOR,
    OTHER,
    PAGE,
    TRAFFIC,
    RunPaths,
    file_name,
    library_page,
    main,
    run_picture,
)

from eidrive_scenario.extensions.library import LibraryScenario, describe_scenarios
from eidrive_scenario.reporting.drawing.top_view import GROUND, LANE, RoadDrawing

ROOT = Path(__file__).parents[2]


def color(text: str) -> list[int]:
    return [int(text[n : n + 2], 16) for n in (5, 3, 1)]


def test_picture_has_actors_paths_and_lanes_at_their_places() -> None:
    """The section is 60 m by 40 m, 10 pixels per meter: margins of 8 m around the ego from x = 0 to 44."""
    run = RunPaths()
    for x in range(45):
        boxes = [(float(x), 0.0, 1.0, 4.0, 2.0, 1.5, 0.0), (10.0, 12.0, 1.0, 4.0, 2.0, 1.5, 0.0)]
        run.add(("Ego", "Car"), [*boxes[:1], (10.0, -12.0, 1.0, 4.0, 2.0, 1.5, 0.0)])
        run.add(("Swarm.0001",), [(30.0, 12.0, 1.0, 4.0, 2.0, 1.5, 0.0)])
    lane = np.array([(-8.0, -2.0), (52.0, -2.0), (52.0, 2.0), (-8.0, 2.0)])
    roads = RoadDrawing((("driving", lane),))
    image = run_picture(run, roads, {"Car": OTHER, "Ego": EGO_COLOR}, size=(600, 400))
    assert image.shape == (400, 600, 3)

    def at(x: float, y: float) -> list[int]:
        bottom = -12.0 - 8.0 - (40.0 - 28.0) / 2.0
        found: list[int] = image[round(400 - 10 * (y - bottom)), round(10 * (x + 8.0))].tolist()
        return found

    assert at(-0.5, 0.3) == color(EGO_COLOR)
    assert at(20.0, 0.0) == color(EGO_COLOR)
    assert at(20.0, 1.5) == color(LANE)
    assert at(9.5, -12.3) == color(OTHER)
    assert at(29.5, 11.7) == color(TRAFFIC)
    assert at(20.0, -12.0) == color(GROUND)


def test_page_lists_all_scenarios_with_pictures() -> None:
    scenarios = describe_scenarios()
    assert library_page(scenarios) == (ROOT / PAGE).read_text(encoding="utf-8"), (
        "make library-pictures updates the page"
    )
    pictures = {path.name: path.stat().st_size for path in (ROOT / "docs" / "library").iterdir()}
    assert set(pictures) == {file_name(scenario) for scenario in scenarios}
    assert max(pictures.values()) < 40_000


def test_page_escapes_bars_of_tables() -> None:
    assert "car \\| truck |" in library_page([LibraryScenario("a/b", "a", "car | truck")])


@pytest.mark.exhaustive
def test_command_draws_selected_scenarios(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["coop/scenario_1", "--root", str(tmp_path)]) == 0
    (path,) = (tmp_path / "docs" / "library").iterdir()
    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape == (300, 480, 3)
    assert "coop/scenario_1" in (tmp_path / PAGE).read_text(encoding="utf-8")
    (tmp_path / "file").touch()
    assert main(["coop/scenario_1", "--root", str(tmp_path / "file")]) == 2
    assert "file" in capsys.readouterr().err
