"""Hints for missing files: similar files beside them, or names of the library."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.files.similar_paths import file_suggestion
from eidrive_scenario.gym import EidriveEnv
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings, run_file

PASSING_BY = Path(__file__).parents[1] / "data" / "passing_by.xosc"
LIBRARY = ["coop/scenario_1", "ncap/crossing_car"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder with two scenarios in a subfolder, and a channel file beside them."""
    inner = tmp_path / "scenarios"
    inner.mkdir()
    for name in ("near_miss.xosc", "cut_in.xosc", "tunnel.yaml", "notes.txt"):
        (inner / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("scenarios/near_mis.xosc", "did you mean 'scenarios/near_miss.xosc'?"),
        ("scenarios/NEAR_MISS.xosc", "did you mean 'scenarios/near_miss.xosc'?"),
        ("scenarios/near_miss", "did you mean 'scenarios/near_miss.xosc'?"),
        ("senarios/cut_in.xosc", "did you mean 'scenarios/cut_in.xosc'?"),
        ("senarios/cutin.xosc", "did you mean 'scenarios/cut_in.xosc'?"),
        ("scenarios/zzz.xosc", "known: scenarios/cut_in.xosc, scenarios/near_miss.xosc"),
        ("coop/scenaro_1", "did you mean 'coop/scenario_1'?"),
        ("zzz", "known: coop/scenario_1, ncap/crossing_car"),
        ("", "known: coop/scenario_1, ncap/crossing_car"),
        ("x" * 5000, "known: coop/scenario_1, ncap/crossing_car"),
        ("a\0b/c.xosc", "known: coop/scenario_1, ncap/crossing_car"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_file_suggestion_prefers_neighbors(given: str, expected: str) -> None:
    assert file_suggestion(given, (".xosc",), LIBRARY) == expected


def test_file_suggestion_omits_broken_links_and_folders(folder: Path) -> None:
    (folder / "lost.xosc").symlink_to("nowhere")
    (folder / "loss.xosc").mkdir()
    assert file_suggestion("lost.xosc", (".xosc",)) == "check the path"


def test_file_suggestion_is_relative_to_the_folder_of_the_path(folder: Path) -> None:
    """A scenario names its channel file relative to its own folder."""
    inner = folder / "scenarios"
    assert file_suggestion("tunel.yaml", (".yaml",), folder=inner) == "did you mean 'tunnel.yaml'?"
    assert file_suggestion("zzz.yaml", (".yaml",), folder=inner, otherwise="give one") == "give one"
    assert file_suggestion("tunel.yaml", (".yaml",), folder=folder / "zzzzzz") == "check the path"


def run_with(**settings: str) -> Callable[[], object]:
    return lambda: run_file(PASSING_BY, settings=RunSettings(**settings))  # type: ignore[arg-type]


def test_missing_inputs_name_a_similar_one(folder: Path) -> None:
    (folder / "recording.mcap").touch()
    command = '<UserDefinedAction><CustomCommandAction type="eidrive.channel">tunel.yaml</CustomCommandAction>'
    text = PASSING_BY.read_text().replace("<UserDefinedAction>", f"{command}</UserDefinedAction><UserDefinedAction>", 1)
    (folder / "scenarios" / "late.xosc").write_text(text)
    actions: tuple[tuple[Callable[[], object], str], ...] = (
        (lambda: resolve_scenario("scenarios/cutin.xosc"), "scenarios/cut_in.xosc"),
        (lambda: load_scenario("scenarios/cutin.xosc"), "scenarios/cut_in.xosc"),
        (lambda: EidriveEnv("coop/scenaro_1"), "coop/scenario_1"),
        (run_with(channel="scenarios/tunel.yaml"), "scenarios/tunnel.yaml"),
        (run_with(criteria="scenarios/tunel.yaml"), "scenarios/tunnel.yaml"),
        (run_with(weather="sunnny"), "sunny"),
        (lambda: run_file("scenarios/late.xosc"), "tunnel.yaml"),
        (lambda: read_recording("recordin.mcap"), "recording.mcap"),
    )
    for action, expected in actions:
        with pytest.raises(InputError) as caught:
            action()
        assert caught.value.diagnostics[0].hint == f"did you mean {expected!r}?"
