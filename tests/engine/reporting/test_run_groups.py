"""Groups of runs in a report, by differing settings, with the content of each channel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lxml import html
from report_table import listed_runs

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.reported_run import ReportedRun, parse_run
from eidrive_scenario.experiments.single_run import as_json_text, run_and_save
from eidrive_scenario.files.bounded import load_json
from eidrive_scenario.recording.run_files import read_result
from eidrive_scenario.reporting.run_report.report import write_run_report
from eidrive_scenario.reporting.run_report.run_groups import group_runs
from eidrive_scenario.reporting.run_report.run_table import run_table
from eidrive_scenario.simulation import RunSettings

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


def run(seed: int = 1, **settings: Any) -> dict[str, Any]:
    result = run_and_save(PASSING_BY, seed=seed, settings=RunSettings(time_limit=0.1, **settings))
    found: dict[str, Any] = load_json(as_json_text(result).encode())
    return found


def reports(*results: dict[str, Any]) -> list[ReportedRun]:
    return [parse_run(result) for result in results]


def late(seconds: float) -> str:
    return f"{{delay: {{kind: constant, seconds: {seconds}}}}}"


def test_group_runs_separates_channel_contents_but_not_seeds() -> None:
    groups = group_runs(reports(*(run(seed, channel=late(delay)) for seed in (1, 2) for delay in (0.1, 0.2))))
    assert [(group.channel, group.differing) for group in groups] == [
        ("custom", {"channel.delay.seconds": "0.1"}),
        ("custom", {"channel.delay.seconds": "0.2"}),
    ]
    assert [[one.seed for one in group.runs] for group in groups] == [[1, 2], [1, 2]]
    assert "seconds: 0.1" in groups[0].content


@pytest.mark.parametrize(
    ("changes", "differing"),
    [
        ({"parameters": {"OtherY": "6"}}, {"parameters.OtherY": ("5.0", "6")}),
        ({"dt": 0.1}, {"dt": ("0.05", "0.1")}),
        ({"user_values": {"mood": "3"}}, {"user_values": ("",), "user_values.mood": ("", "3")}),
        ({"weather": "storm"}, {"weather": ("", "storm")}),
    ],
)
def test_group_runs_states_differing_setting(changes: dict[str, Any], differing: dict[str, tuple[str, str]]) -> None:
    groups = group_runs(reports(run(), run(**changes)))
    assert len(groups) == 2
    for name, values in differing.items():
        assert {group.differing.get(name, "") for group in groups} == set(values)


def test_group_runs_separates_changed_scenario_files() -> None:
    first, second = run(), run()
    second["settings"]["files"][0]["sha256"] = "f" * 64
    groups = group_runs(reports(first, second))
    assert {group.differing["files.scenario passing_by.xosc"] for group in groups} == {
        first["settings"]["files"][0]["sha256"][:12],
        "f" * 12,
    }


def swept(speed: float, detector: str = "oracle", *, store: str = "a.db", **settings: Any) -> ReportedRun:
    """Run of a sweep over a speed; `settings` replace those that follow from it."""
    parameters = {"Speed": str(speed), "Limit": str(2.0 * speed)}
    content: dict[str, Any] = {
        "parameters": parameters,
        "stations": {"Ego": {"target_speed": speed, "detector": detector, "range": 50.0}},
        **settings,
    }
    return ReportedRun(
        scenario="s",
        seed=1,
        passed=True,
        end_reason="stop trigger",
        parameters=parameters,
        settings=content,
        axes={"Speed": speed, "detector": detector},
        sweep=store,
    )


def test_settings_that_follow_from_an_axis_do_not_separate_groups() -> None:
    """A parameter that is an expression of the axis, and a property of a station."""
    runs = [swept(speed, detector) for speed in (8.0, 10.0, 12.0) for detector in ("oracle", "lidar")]
    groups = group_runs(runs)
    assert [(dict(group.differing), len(group.runs), group.varied) for group in groups] == [
        ({"detector": "oracle"}, 3, ("Speed",)),
        ({"detector": "lidar"}, 3, ("Speed",)),
    ]


@pytest.mark.parametrize(
    ("delays", "expected"),
    [
        ((0.2, 0.2), "0.2"),
        ((0.3, 0, 0.1), "varies: 0, 0.1, 0.3"),
        (range(1, 21), "varies: 1 … 20 (20 values)"),
        ((0.1, {"mean": 1}), "varies: 0.1, {mean: 1}"),
    ],
)
def test_content_of_channel_states_values_that_vary(delays: Any, expected: str) -> None:
    """The file of the channel refers to the speed, the axis of the sweep, as `seconds: $Speed` does."""
    profile = {"name": "late", "range": 300.0}
    runs = [
        swept(float(index), channel_profile={**profile, "delay": {"kind": "constant", "seconds": delay}})
        for index, delay in enumerate(delays)
    ]
    (group,) = group_runs(runs)
    assert group.content == f"{{range: 300, delay: {{kind: constant, seconds: {expected}}}}}"


def test_content_of_channels_of_different_kinds_states_absent_settings() -> None:
    delays = ({"kind": "constant", "seconds": 0.1}, {"kind": "normal", "mean": 0.2})
    (group,) = group_runs([swept(float(index), channel_profile={"delay": one}) for index, one in enumerate(delays)])
    expected = "{kind: varies: constant, normal, seconds: varies: 0.1, absent, mean: varies: 0.2, absent}"
    assert group.content == f"{{delay: {expected}}}"


def test_settings_of_other_sweeps_separate_groups() -> None:
    """The second sweep continues the axis of the first one with another range of the detector."""
    far: dict[str, Any] = {"stations": {"Ego": {"target_speed": 8.0, "detector": "oracle", "range": 80.0}}}
    runs = [*(swept(speed) for speed in (8.0, 10.0)), *(swept(speed, store="b.db", **far) for speed in (12.0, 14.0))]
    assert {group.differing["stations.Ego.range"] for group in group_runs(runs)} == {"50", "80"}


def test_settings_that_differ_at_one_point_separate_groups() -> None:
    other: dict[str, Any] = {"stations": {"Ego": {"target_speed": 7.0, "detector": "oracle", "range": 50.0}}}
    groups = group_runs([swept(8.0), swept(10.0), swept(8.0, **other)])
    assert {group.differing["stations.Ego.target_speed"] for group in groups} == {"7", "8", "10"}


def test_runs_without_an_axis_have_the_value_of_their_settings() -> None:
    """The time limit differs, too, so that the delay distinguishes groups as well as runs of one."""

    def run_at(delay: float, limit: str, *, is_swept: bool) -> ReportedRun:
        settings: dict[str, Any] = {"channel_profile": {"delay": {"seconds": delay}}, "time_limit": limit}
        return swept(8.0, **settings).model_copy(update={"axes": {"channel.delay.seconds": delay} if is_swept else {}})

    runs = [*(run_at(delay, "9", is_swept=True) for delay in (0.0, 0.2)), run_at(0.1, "5", is_swept=False)]
    (column,) = (one for one in run_table(group_runs(runs))["columns"] if one["title"] == "channel.delay.seconds")
    assert sorted(column["values"]) == [0.0, 0.1, 0.2]


def test_runs_of_a_distribution_are_one_group_with_its_varied_parameters() -> None:
    runs = [
        swept(speed, run=None, varied=["Speed"]).model_copy(update={"run": number, "axes": {}, "sweep": ""})
        for number, speed in enumerate((8.0, 10.0))
    ]
    (group,) = group_runs(runs)
    assert (dict(group.differing), group.varied) == ({}, ("Speed",))


def test_runs_of_different_files_of_one_name_are_different_groups() -> None:
    """Other numbers of runs of two distributions, whose files have one name."""
    runs = []
    for number, digest in enumerate(("a" * 64, "a" * 64, "b" * 64)):
        files = [{"role": "scenario", "name": "s.xosc", "sha256": digest}]
        runs.append(swept(8.0, files=files).model_copy(update={"run": number, "axes": {}, "sweep": ""}))
    assert [len(group.runs) for group in group_runs(runs)] == [2, 1]


def test_report_counts_copied_result_once(tmp_path: Path) -> None:
    one = run()
    page = write_run_report([one, dict(one), run(seed=2)], tmp_path)
    tree = html.fromstring(page.read_text(encoding="utf-8"))
    assert tree.xpath("string(//table[@class='overview']/tbody/tr/td[3])") == "0/2"
    assert [listed["seed"] for listed in listed_runs(page)] == [1, 2]
    assert "1 result is a copy of another" in str(tree.xpath("string()"))
    assert (tree.findtext(".//p[@class='lead']") or "").startswith("2 runs: ")


def test_copy_with_a_replay_is_the_one_that_is_listed(tmp_path: Path) -> None:
    (one,) = reports(run())
    page = write_run_report([one, one.model_copy(update={"replay": "replays/one.html"})], tmp_path)
    assert [listed["replay"] for listed in listed_runs(page)] == ["replays/one.html"]


def test_report_contains_channel_settings_and_command_of_each_run(tmp_path: Path) -> None:
    page = write_run_report([run(channel=late(0.1)), run(channel=late(0.25))], tmp_path)
    text = str(html.fromstring(page.read_text(encoding="utf-8")).xpath("string()"))
    assert "channel.delay.seconds: 0.1" in text
    assert "delay: {kind: constant, seconds: 0.25}" in text
    last = listed_runs(page)[-1]
    assert last["command"] == f"eidrive run {PASSING_BY} --channel '{late(0.25)}' --seed 1 --time-limit 0.1"
    assert last["settings of the run"]["channel_profile.delay.seconds"] == "0.25"
    assert "sha256" in last["settings of the run"]["files"]


def test_report_escapes_names(tmp_path: Path) -> None:
    attack = "<img src=x onerror=alert(1)>"
    one = run()
    one |= {"scenario": attack, "channel": attack, "command": attack, "end_reason": attack}
    one["settings"]["channel_profile"] = {attack: attack}
    one["metrics"] = {attack: 1.0, "inf": float("inf")}
    one["criteria"][0]["reason"] = attack
    page = write_run_report([one, run()], tmp_path).read_text(encoding="utf-8")
    assert "<img" not in page


def test_report_of_unusual_values_is_written(tmp_path: Path) -> None:
    for changes in (
        {"settings": {"stations": [[1]], "parameters": 3, "drawn": 5, "files": [1, {"x": 2}], "channel_profile": "x"}},
        {"metrics": {"a": 1e308, "b": float("nan")}, "settings": {}},
        {"run": 3, "parameters": {"A": "1"}},
        {"scenario": "\ud800", "seed": 10**50},
    ):
        assert write_run_report([run() | changes, run()], tmp_path).exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000 + "]" * 100_000, "nested"),
        ('{"trace_hash": ' + "[" * 900 + "]" * 900 + "}", "nested deeper than 40 levels"),
        ('{"trace_hash": ' + "9" * 5000 + "}", "not JSON"),
        ('{"trace_hash": [' + "0," * 10_000_001 + "0]}", "more than 10000000 values"),
        ("\xff", "not the result of a run|not JSON"),
        ("null", "not the result of a run"),
    ],
    ids=["deep", "rather deep", "long number", "many values", "no UTF-8", "null"],
)
def test_read_result_of_hostile_file_raises_input_error(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "result.json").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match=message):
        read_result(tmp_path / "result.json")
