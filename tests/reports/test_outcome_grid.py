"""Outcomes over two parameters, and their heat maps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from eidrive_reports.heat_maps import GridCell, OutcomeGrid, heat_map, main, run_outcome_grid
from matplotlib.collections import QuadMesh
from openscenario_xml import deterministic_xml, distribution_xml, values_xml

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import library_path

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def file(*distributions: str) -> Path:
        path = tmp_path / "grid.xosc"
        scenario = library_path() / "ncap" / "crossing_car.xosc"
        path.write_bytes(distribution_xml(deterministic_xml(*distributions), scenario=str(scenario)))
        return path

    return file


@pytest.mark.exhaustive
def test_grid_holds_each_value_in_each_arm(write: Write) -> None:
    path = write(values_xml("EgoKmh", "55", "20"), values_xml("OtherKmh", "50"))
    arms = {"alone": {"Participants": "none"}, "together": {"Participants": "rsu"}}
    grid = run_outcome_grid(path, arms=arms, parameters={"Planner": "conflict_area"}, workers=1)
    assert (grid.name, grid.x_name, grid.y_name) == ("grid", "EgoKmh", "OtherKmh")
    assert [(cell.x, cell.y) for cell in grid.arms["alone"]] == [(55.0, 50.0), (20.0, 50.0)]
    assert [cell.passed for cell in grid.arms["alone"]] == [False, True]
    assert [cell.passed for cell in grid.arms["together"]] == [True, True]
    assert (grid.collisions("alone"), grid.collisions("together")) == (1, 0)
    speed = grid.arms["alone"][0].impact_speed
    assert speed is not None
    assert 50 / 3.6 - 0.1 <= speed <= (55**2 + 50**2) ** 0.5 / 3.6


@pytest.mark.parametrize(
    ("distributions", "message"),
    [
        ([values_xml("EgoKmh", "20", "30")], "the distribution varies 1 parameters (expected 2"),
        (
            [values_xml("EgoKmh", "20"), values_xml("Participants", "none", "rsu")],
            "parameter 'Participants': not a number (got 'none')",
        ),
    ],
)
def test_distribution_without_two_axes_is_an_error(
    write: Write, distributions: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(*distributions)
    with pytest.raises(SettingError) as caught:
        run_outcome_grid(path, workers=1)
    assert message in str(caught.value)
    assert main([str(path), "--out", str(path.parent)]) == 2
    assert message in capsys.readouterr().err


def test_heat_map_shows_speeds_and_counts() -> None:
    cells = (GridCell(20, 3, True, None), GridCell(30, 3, False, 5.0), GridCell(20, 4, False, None))
    figure = heat_map(OutcomeGrid("grid", "EgoKmh", "WalkerKmh", {"alone": cells, "together": cells[:1]}))
    maps = [axes for axes in figure.axes if axes.get_title()]
    assert [axes.get_title() for axes in maps] == ["alone\n1 of 3 collide", "together\n0 of 1 collide"]
    others, speeds = (mesh.get_array() for mesh in maps[0].collections if isinstance(mesh, QuadMesh))
    assert others is not None
    assert speeds is not None
    np.testing.assert_array_equal(np.ma.filled(others, np.nan), [[0.0, 1.0], [1.0, np.nan]])
    np.testing.assert_array_equal(np.ma.filled(speeds, np.nan), [[np.nan, 18.0], [np.nan, np.nan]])


@pytest.mark.exhaustive
def test_command_writes_one_figure_per_distribution(write: Write, tmp_path: Path) -> None:
    path = write(values_xml("EgoKmh", "20"), values_xml("OtherKmh", "50"))
    assert main([str(path), "--out", str(tmp_path / "maps"), "--workers", "1", "--param", "LeadTime=2"]) == 0
    image = matplotlib.image.imread(tmp_path / "maps" / "grid.png")
    assert image.shape[1] > image.shape[0] > 100


@pytest.mark.parametrize(("option", "message"), [("--workers=0", "not a positive number"), ("--param=A", "NAME=VALUE")])
def test_invalid_option_is_an_error(option: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([option])
    assert caught.value.code == 2
    assert message in capsys.readouterr().err
