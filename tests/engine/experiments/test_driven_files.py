"""Tables of files by others, driven by a planner."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import object_xml, road_file_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, speed_xml, teleport_xml

from eidrive_scenario.experiments import driven_corpora, driven_files
from eidrive_scenario.experiments.driven_corpora import GROUPS, Group, summary
from eidrive_scenario.experiments.driven_files import REFERENCE, STACK, DrivenRun, read_record, table, worse_runs


def run(arm: str = STACK, number: int = 0, *, file: str = "a.xosc", **given: object) -> DrivenRun:
    return DrivenRun(file, number, arm, 1, **given)  # type: ignore[arg-type]


def write(folder: Path, ahead: float) -> Path:
    """Write a file of another engine: Ego with 10 m/s, and a standing car in its lane."""
    (folder / "road.xodr").write_text(map_xml(road_xml(lanes=lanes_xml(right=1, left=0), length=300.0)))
    path = folder / "a.xosc"
    init = init_xml("Ego", speed_xml(10), teleport_xml(lane_position_xml(-1, 20.0)))
    init += init_xml("Other", teleport_xml(lane_position_xml(-1, 20.0 + ahead)))
    entities = object_xml("Ego") + object_xml("Other")
    path.write_bytes(scenario_xml(road=road_file_xml("road.xodr"), entities=entities, init=init, stop=end_xml(8)))
    return path


def test_table_counts_collisions_of_the_stack_only() -> None:
    runs = [
        run(collided=True, at_fault=True, distance=100.0, braking=3.0),
        run(REFERENCE, collided=False),
        run(number=1, collided=True, at_fault=True, distance=200.0, braking=8.0),
        run(REFERENCE, 1, collided=True),
        run(number=2, excluded=True),
        run(file="b.xosc", failed=("keep_lane",), judged=2),
        run(file="c.xosc", error="c.xosc:3: no road"),
    ]
    assert table(runs).splitlines()[2:] == [
        "| a.xosc | 2 | 2 | 2 | 1 | 150 | 8.0 | - |",
        "| b.xosc | 1 | 0 | 0 | - | 0 | 0.0 | `keep_lane` |",
        "| c.xosc | 1 | c.xosc:3: no road | | | | | |",
    ]


def test_worse_runs_are_those_that_the_reference_avoids() -> None:
    runs = [run(number=n, at_fault=True, collided=True) for n in range(3)]
    runs += [run(REFERENCE, 0), run(REFERENCE, 1, collided=True), run(REFERENCE, 2, error="none")]
    assert worse_runs(runs) == runs[:1]


def test_summary_has_a_line_per_group() -> None:
    group = Group("x", "Title", "folder", ("*.xosc",))
    runs = [run(), run(number=1, collided=True), run(file="b.xosc", error="no road"), run(number=2, excluded=True)]
    assert summary([(group, runs)]).splitlines()[2:] == ["| Title | 2 | 3 | 1 | 1 | 0 | - |"]


def test_main_drives_a_file_and_resumes_from_its_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With 10 m/s the vehicle stops before a car 70 m ahead: the distance is shorter than the gap of the bodies."""
    arguments = [str(write(tmp_path, 70.0)), "--out", str(tmp_path), "--workers", "1"]
    driven_files.main(arguments)
    (only,) = read_record(tmp_path / "driven_files.jsonl")
    assert (only.collided, only.error, only.arm) == (False, "", STACK)
    assert 40.0 < only.distance < 70.0 - 4.5
    assert only.duration == pytest.approx(8.0, abs=0.1)
    first = capsys.readouterr().out
    (tmp_path / "a.xosc").write_text("damaged")
    (tmp_path / "a.xosc").write_bytes(write(tmp_path, 30.0).read_bytes())
    driven_files.main([*arguments, "--resume"])
    assert capsys.readouterr().out == first
    driven_files.main(arguments)
    assert capsys.readouterr().out != first


def test_error_of_a_file_is_in_its_row_without_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path, 70.0)
    driven_files.main([str(path), "--drive", "Unknown", "--out", str(tmp_path), "--workers", "1"])
    output = capsys.readouterr().out
    assert "the scenario has no entity 'Unknown'" in output
    assert str(tmp_path) not in output


@pytest.mark.parametrize(
    ("arguments", "folders", "message"),
    [
        ([], (), "EIDRIVE_CORPORA is not set"),
        ([], ("EIDRIVE_CORPORA",), "EIDRIVE_MAPS is not set"),
        (["alkss"], ("EIDRIVE_CORPORA", "EIDRIVE_MAPS"), "unknown group 'alkss'"),
    ],
)
def test_corpora_without_folders_or_with_an_unknown_group_are_an_error(
    arguments: list[str],
    folders: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("EIDRIVE_CORPORA", "EIDRIVE_MAPS"):
        monkeypatch.delenv(name, raising=False)
    for name in folders:
        monkeypatch.setenv(name, str(tmp_path))
    with pytest.raises(SystemExit) as exit_:
        driven_corpora.main([*arguments, "--out", str(tmp_path)])
    assert exit_.value.code == 2
    assert message in capsys.readouterr().err


def test_corpora_of_a_folder_are_driven_by_groups(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "asam-1.3.1"
    folder.mkdir()
    write(folder, 100.0).rename(folder / "CutIn.xosc")
    monkeypatch.setenv("EIDRIVE_CORPORA", str(tmp_path))
    monkeypatch.setenv("EIDRIVE_MAPS", str(tmp_path))
    driven_corpora.main(["asam", "--out", str(tmp_path / "out"), "--workers", "1"])
    output = capsys.readouterr().out
    assert "| ASAM | 1 | 1 | 0 | 0 | 0 | - |" in output.splitlines()
    assert output == (tmp_path / "out" / "driven_corpora.md").read_text()
    assert len({group.name for group in GROUPS}) == len(GROUPS)
