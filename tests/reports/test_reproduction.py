"""Reproduction of the paper: record, digests, tables and parts."""

from __future__ import annotations

import csv
import io
import os
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from eidrive_reports.reproduction import provenance
from eidrive_reports.reproduction.episodes import ObjectCounter
from eidrive_reports.reproduction.layout import Column, DataTable, Row, as_csv, plain
from eidrive_reports.reproduction.part import Part, seed_of_block
from eidrive_reports.reproduction.parts import ALL, PARTS, selected_detectors, selected_parts
from eidrive_reports.reproduction.provenance import job_digest
from eidrive_reports.reproduction.reproduce import Record
from known_episodes import episode
from lone_car import lone_car
from opendrive_xml import map_xml, road_xml
from openscenario_xml import road_file_xml, scenario_xml

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.registry import register, registry
from eidrive_scenario.simulation import RunSettings

# Record


def test_record_returns_the_episodes_of_earlier_calls(tmp_path: Path) -> None:
    path = tmp_path / "new" / "part.jsonl"
    added = [episode(seed=seed, center=1.0 / 3.0) for seed in (1, 2)]
    with Record.open(path) as record:
        assert record.runs == {}
        for one in added:
            record.add(one)
    with Record.open(path) as record:
        assert list(record.runs.values()) == added
    with Record.open(path, restart=True) as record:
        assert record.runs == {}
    assert path.read_bytes() == b""


def test_incomplete_last_line_of_a_killed_process_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "part.jsonl"
    with Record.open(path) as record:
        record.add(episode(seed=1))
        record.add(episode(seed=2))
    complete = path.read_bytes()
    path.write_bytes(complete[:-20])
    with Record.open(path) as record:
        assert [one.seed for one in record.runs.values()] == [1]
        record.add(episode(seed=2))
    assert path.read_bytes() == complete


@pytest.mark.parametrize("line", [b"{}", b"nonsense", b"\xff\xfe", b'{"scenario": 1}', b"[" * 5000])
def test_damaged_record_is_an_error_with_its_line(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "part.jsonl"
    with Record.open(path) as record:
        record.add(episode())
    path.write_bytes(path.read_bytes() + line + b"\n")
    with pytest.raises(SettingError, match=r"part\.jsonl:2: the record is damaged: .*--restart"), Record.open(path):
        pass
    with Record.open(path, restart=True) as record:
        assert record.runs == {}


def test_record_of_another_process_and_unwritable_folders_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "part.jsonl"
    with Record.open(path), pytest.raises(SettingError, match="another run writes this file"), Record.open(path):
        pass
    with pytest.raises(SettingError, match="cannot write: File exists"), Record.open(path / "below.jsonl"):
        pass
    os.mkfifo(tmp_path / "pipe")
    for other in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(SettingError, match="cannot write: not a regular file"), Record.open(other):
            pass


def test_digest_distinguishes_settings_and_scenarios() -> None:
    digests = {
        job_digest("coop/scenario_1", RunSettings()),
        job_digest("coop/scenario_2", RunSettings()),
        job_digest("coop/scenario_1", RunSettings(channel="ideal")),
        job_digest("coop/scenario_1", RunSettings(dt=0.03)),
    }
    assert len(digests) == 4
    assert job_digest("coop/scenario_1", RunSettings()) in digests


def test_digest_changes_with_the_road_file_of_a_scenario_of_a_user(tmp_path: Path) -> None:
    digests = set()
    for number, length in enumerate((300.0, 200.0, 300.0)):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "road.xodr").write_text(map_xml(road_xml(length=length)))
        (folder / "own.xosc").write_bytes(scenario_xml(road=road_file_xml("road.xodr")))
        digests.add(job_digest(str(folder / "own.xosc"), RunSettings()))
    assert len(digests) == 2


def test_digest_changes_with_the_extension_that_only_a_scenario_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "digest_own_planner.py"
    code = "from eidrive_scenario.driving.planning.route_planner import RoutePlanner\nclass Own(RoutePlanner): ...\n"
    module.write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    scenario = tmp_path / "own.xosc"
    scenario.write_bytes(lone_car(1.0).replace(b'value="route"', b'value="own"'))
    register("planners", "own", "digest_own_planner:Own")
    try:
        before = job_digest(str(scenario), RunSettings())
        module.write_text(f"{code}# changed\n")
        assert job_digest(str(scenario), RunSettings()) != before
    finally:
        del registry("planners")._points["own"]


def test_seeds_of_blocks_differ_beyond_a_thousand_episodes() -> None:
    seeds = {(block, seed): seed_of_block(seed, block, 3) for block in range(3) for seed in range(1, 2501)}
    assert len(set(seeds.values())) == 7500
    assert all(seeds[block, seed] == 1000 * block + seed for block, seed in seeds if seed <= 1000)


def test_tables_in_the_checkout_do_not_change_its_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call precedes the tables. `+` marks a file that differs before the runs."""

    def git(*arguments: str) -> str:
        user = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        return subprocess.check_output(["git", *user, *arguments], cwd=tmp_path, text=True).strip()

    table = tmp_path / "xosc" / "table.csv"
    table.parent.mkdir()
    table.write_text("1")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "first")
    monkeypatch.setattr(provenance, "library_path", lambda: table.parent)
    provenance.commit.cache_clear()
    before = provenance.commit()
    table.write_text("12")
    assert provenance.commit() == before == git("rev-parse", "HEAD")
    provenance.commit.cache_clear()
    assert provenance.commit() == f"{before}+"
    provenance.commit.cache_clear()


def test_counter_counts_objects_after_fusion_while_the_station_is_present() -> None:
    counter = ObjectCounter("Ego")
    for classes in (None, [], ["car", "misc", "van", "bicycle"]):
        steps = {} if classes is None else {"Ego": SimpleNamespace(fused=SimpleNamespace(classes=classes))}
        counter.observe(SimpleNamespace(steps=steps))  # type: ignore[arg-type]
    counter.close()
    assert counter.counts == [0, 3]


# Layout


def test_csv_has_all_digits_and_markdown_the_format() -> None:
    rows: tuple[Row, ...] = (
        {"name": "a", "value": 1.0 / 3.0, "low": None, "holds": True},
        {"name": "b", "value": 2.0, "low": 1.0},
    )
    columns = (plain("name", "name"), Column("range", "{low:.1f} to {value:.2f}"))
    lines = DataTable("t", columns, rows).markdown().splitlines()
    assert lines == ["| name | range |", "|---|---|", "| a | - |", "| b | 1.0 to 2.00 |"]
    read = list(csv.DictReader(io.StringIO(as_csv(rows[:1]))))
    assert read == [{"name": "a", "value": repr(1.0 / 3.0), "low": "", "holds": "true"}]
    assert float(read[0]["value"]) == 1.0 / 3.0
    assert as_csv([]) == ""


# Parts


def test_parts_are_in_the_order_of_the_paper() -> None:
    assert selected_parts([ALL]) == tuple(PARTS.values())
    assert [part.name for part in selected_parts(["table3", "table2", "table3"])] == ["table2", "table3"]
    with pytest.raises(SettingError, match="unknown name 'tabel2'; did you mean 'table2'"):
        selected_parts(["tabel2"])


def test_detectors_are_those_of_the_part() -> None:
    part = PARTS["table2"]
    assert selected_detectors(part, []) == ("oracle", "yolov5")
    assert selected_detectors(part, ["yolov5", "oracle"]) == ("oracle", "yolov5")
    with pytest.raises(SettingError, match="unknown name 'yolo'"):
        selected_detectors(part, ["yolo"])


@pytest.mark.parametrize("part", PARTS.values(), ids=lambda part: part.name)
def test_jobs_are_distinct_and_ordered_by_seed(part: Part) -> None:
    jobs = part.jobs(2, part.detectors)
    assert len(set(map(Record.key, jobs))) == len({(job.scenario, job.arm, job.seed) for job in jobs}) == len(jobs)
    episodes = [job.seed % 1000 for job in jobs]
    assert episodes == sorted(episodes)
    assert set(episodes) == {1, 2}
