"""Tables of files by others, driven by a planner."""

from __future__ import annotations

from pathlib import Path

import pytest
from eidrive_reports import driven_corpora, driven_files, driven_runs
from eidrive_reports.driven_corpora import GROUPS, Group, summary
from eidrive_reports.driven_files import table, worse_runs
from eidrive_reports.driven_runs import (
    DRAWS,
    REFERENCE,
    STACK,
    DrivenJob,
    DrivenRecord,
    DrivenRun,
    jobs_of_file,
    run_recorded,
)
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import (
    controller_xml,
    deterministic_xml,
    distribution_xml,
    object_xml,
    road_file_xml,
    scenario_xml,
    values_xml,
)
from rich.console import Console
from storyboard_xml import end_xml, init_xml, lane_position_xml, speed_xml, teleport_xml

from eidrive_scenario.errors import ConstraintError, Diagnostic
from eidrive_scenario.openscenario import load_distribution
from eidrive_scenario.simulation import RunSettings


def read(record: Path) -> list[DrivenRun]:
    with DrivenRecord.open(record) as driven:
        return list(driven.runs.values())


def run(arm: str = STACK, number: int = 0, *, file: str = "a.xosc", **given: object) -> DrivenRun:
    return DrivenRun(file, number, arm, 1, drive="Ego", **given)  # type: ignore[arg-type]


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
        *(run(number=n, file="c.xosc", error="c.xosc:3: a|b") for n in range(2)),
        run(number=2, file="c.xosc", distance=50.0),
    ]
    assert table(runs, has_reference=True).splitlines()[2:] == [
        "| a.xosc | 2 | 2 | 2 | 1 | 150 | 8.0 | - |",
        "| b.xosc | 1 | 0 | 0 | 0 | 0 | 0.0 | `keep_lane` |",
        "| c.xosc | 2 | c.xosc:3: a\\|b |  |  |  |  |  |",
        "| c.xosc | 1 | 0 | 0 | 0 | 50 | 0.0 | - |",
    ]


def test_worse_runs_are_those_that_the_reference_avoids() -> None:
    runs = [run(number=n, at_fault=True, collided=True) for n in range(3)]
    runs += [run(REFERENCE, 0), run(REFERENCE, 1, collided=True), run(REFERENCE, 2, error="none")]
    assert worse_runs(runs) == runs[:1]


def test_reference_driver_repeats_runs_with_a_contact_by_own_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[tuple[int, str]] = []

    def run_of(job: DrivenJob) -> DrivenRun:
        done.append((job.number, job.arm))
        contact = job.number in (1, 2)
        return run(job.arm, job.number, collided=contact, at_fault=contact and job.number == 1)

    monkeypatch.setattr(driven_runs, "run_of", run_of)
    jobs = [
        DrivenJob("a.xosc", arm, 1, RunSettings(), "a.xosc", number, "Ego")
        for number in range(3)
        for arm in (STACK, REFERENCE)
    ]
    record = tmp_path / "record.jsonl"
    runs = run_recorded(jobs, record, workers=1, console=Console(quiet=True), title="x")
    assert done == [(0, STACK), (1, STACK), (2, STACK), (1, REFERENCE)]
    assert [(one.number, one.arm) for one in runs] == [(0, STACK), (1, STACK), (1, REFERENCE), (2, STACK)]
    assert run_recorded(jobs, record, workers=1, console=Console(quiet=True), title="x") == runs
    assert len(done) == 4


def test_summary_has_a_line_per_group() -> None:
    group = Group("x", "Title", "folder", ("*.xosc",))
    runs = [run(), run(number=1, collided=True), run(file="b.xosc", error="no road"), run(number=2, excluded=True)]
    assert summary([(group, runs)]).splitlines()[2:] == ["| Title | 2 | 3 | 1 | 1 | 0 | - |"]


def test_main_drives_a_file_and_resumes_from_its_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With 10 m/s the vehicle stops before a car 70 m ahead: the distance is shorter than the gap of the bodies."""
    arguments = [str(write(tmp_path, 70.0)), "--out", str(tmp_path), "--workers", "1"]
    driven_files.main(arguments)
    (only,) = read(tmp_path / "driven_files.jsonl")
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


LIMITED = """<ParameterDeclarations><ParameterDeclaration name="Speed" parameterType="double" value="{default}">
<ConstraintGroup><ValueConstraint rule="lessThan" value="{limit}"/></ConstraintGroup></ParameterDeclaration>
<ParameterDeclaration name="Other" parameterType="double" value="0"/></ParameterDeclarations>"""


def write_variation(folder: Path, limit: int, count: int = 60) -> Path:
    """Write a distribution over speeds 0 to `count` - 1, of which those below the limit are allowed, and two others."""
    text = write(folder, 70.0).read_text().replace('value="10"', 'value="$Speed"')
    declared = LIMITED.format(default=min(0, limit - 1), limit=limit)
    (folder / "a.xosc").write_text(text.replace("<CatalogLocations", f"{declared}<CatalogLocations", 1))
    path = folder / "v.xosc"
    speeds = values_xml("Speed", *map(str, range(count)))
    path.write_bytes(distribution_xml(deterministic_xml(speeds, values_xml("Other", "1", "2")), scenario="a.xosc"))
    return path


def numbers(path: Path, samples: int) -> list[int]:
    """Return the numbers of the runs of a file; the stack has one run of each."""
    return [job.number for job in jobs_of_file(path, "Ego", "route", samples, None)]


def test_combinations_that_violate_constraints_do_not_count_as_samples(tmp_path: Path) -> None:
    """Of 120 combinations the first 40 satisfy the constraint: the speed varies more slowly than the other."""
    path = write_variation(tmp_path, 20)
    found = numbers(path, 15)
    assert len(found) == 15
    assert found == sorted(set(found))
    assert max(found) < 40
    assert numbers(path, 15) == found


def test_more_samples_contain_fewer_ones(tmp_path: Path) -> None:
    path = write_variation(tmp_path, 20)
    some = load_distribution(path)
    for fewer, more in ((3, 8), (8, 25)):
        assert set(numbers(path, fewer)) < set(numbers(path, more))
    assert {number for number in some.spread(30) if number < 40} <= set(numbers(path, 30)), "as the plain spread does"


def test_samples_end_with_the_distribution(tmp_path: Path) -> None:
    assert numbers(write_variation(tmp_path, 3), 50) == list(range(6))


def test_number_of_combinations_without_a_valid_one_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = []

    def violating(path: object, values: object) -> None:
        read.append(values)
        raise ConstraintError(Diagnostic("outside its constraints"))

    path = write_variation(tmp_path, 20)
    monkeypatch.setattr(driven_runs, "load_scenario", violating)
    assert not numbers(path, 2)
    assert len(read) == 2 * DRAWS


def test_run_with_another_error_is_a_sample(tmp_path: Path) -> None:
    path = write_variation(tmp_path, 20, 3)
    (tmp_path / "a.xosc").write_text("damaged")
    assert numbers(path, 4) == load_distribution(path).spread(4)


def test_record_of_samples_is_continued(tmp_path: Path) -> None:
    path = write_variation(tmp_path, 2, 30)
    arguments = [str(path), "--out", str(tmp_path), "--workers", "1", "--planner", "route", "--samples"]
    driven_files.main([*arguments, "1"])
    (first,) = read(tmp_path / "driven_files.jsonl")
    driven_files.main([*arguments, "2", "--resume"])
    both = read(tmp_path / "driven_files.jsonl")
    assert both[0] == first
    assert [run.excluded for run in both] == [False, False]
    assert len({run.number for run in both}) == 2


@pytest.mark.parametrize("samples", ["0", "-1", "many"])
def test_number_of_samples_is_positive(samples: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        driven_files.main([str(write(tmp_path, 70.0)), "--samples", samples])
    assert exit_.value.code == 2
    assert f"argument --samples: not a positive number (got {samples})" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("Driver=alkss", "--reference: unknown controller model 'alkss'; did you mean 'alks'?"),
        ("Drivr=alks", "--reference: a.xosc has no controller 'Drivr'; did you mean 'Driver'?"),
        ("Driver", "--reference: expected CONTROLLER=MODEL"),
    ],
)
def test_unknown_reference_driver_is_an_error(
    reference: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, 70.0)
    text = path.read_text()
    path.write_text(text.replace("</ScenarioObject>", f"{controller_xml(name='Driver')}</ScenarioObject>", 1))
    with pytest.raises(SystemExit) as exit_:
        driven_files.main([str(path), "--reference", reference, "--out", str(tmp_path)])
    assert exit_.value.code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "driven_files.jsonl").exists()
