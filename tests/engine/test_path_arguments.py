"""Paths as arguments of the Python API: any `os.PathLike`; other objects are an error with the name of the argument."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from eidrive_scenario.api import common, experiments, pages, report, run, v2x
from eidrive_scenario.api.run import RunSettings, run_and_save
from eidrive_scenario.errors import InputError, SettingError

SCENARIO = "coop/scenario_1"
BRIEF = RunSettings(time_limit=0.1)


@dataclass(frozen=True)
class OtherPath:
    """Path of another library."""

    path: str

    def __fspath__(self) -> str:
        return self.path


FUNCTIONS: list[tuple[Callable[..., object], str]] = [
    (partial(run_and_save, SCENARIO, settings=BRIEF), "out"),
    (partial(run_and_save, SCENARIO, settings=BRIEF), "below"),
    (partial(run_and_save, SCENARIO, settings=BRIEF), "csv"),
    (partial(run_and_save, SCENARIO, settings=BRIEF), "log"),
    (run.read_recording, "path"),
    (run.judge_recording, "location"),
    (run.add_topics, "recording"),
    (run.load_weather, "source"),
    (v2x.load_profile, "source"),
    (experiments.resolve_scenario, "name"),
    (experiments.from_library, "name"),
    (experiments.definition, "path"),
    (report.draw, "source"),
    (report.show, "run"),
    (partial(report.write_replay, out="replay.html"), "recording"),
    (partial(report.write_report, "runs"), "out"),
    (partial(pages.write_run_report, []), "out"),
    (partial(pages.write_page, template="report.html.jinja"), "out"),
    (partial(pages.write_replays, []), "beside"),
    (partial(pages.write_figure, Figure()), "path"),
    (common.RoadNetwork.load, "path"),
]


@pytest.mark.parametrize("value", [5, b"path", ["path"], object()])
@pytest.mark.parametrize(("function", "argument"), FUNCTIONS)
def test_object_that_is_no_path_is_reported_with_the_argument(
    function: Callable[..., object], argument: str, value: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SettingError) as error:
        function(**{argument: value})
    assert error.value.diagnostics[0].message == f"{argument} is {value!r}"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("function", [run.read_results, partial(report.write_report, out="pages")])
def test_list_of_paths_is_reported_where_each_is_an_argument(function: Callable[..., object]) -> None:
    with pytest.raises(SettingError, match=r"is \['runs'\]; give paths, each as an argument"):
        function(["runs"])


def test_paths_of_other_libraries_are_read_and_written(tmp_path: Path) -> None:
    scenario = OtherPath(str(experiments.resolve_scenario(SCENARIO)))
    result = run_and_save(scenario, out=OtherPath(str(tmp_path / "run")), settings=BRIEF)
    assert result.trace_hash == run.run_file(SCENARIO, settings=BRIEF).trace_hash
    assert run.read_recording(OtherPath(str(tmp_path / "run"))).scenario == SCENARIO
    assert result.command == f"eidrive run {SCENARIO} --seed 1 --time-limit 0.1"


def test_settings_have_paths_of_other_libraries_as_paths(tmp_path: Path) -> None:
    profile, stack, criteria = (tmp_path / name for name in ("profile.yaml", "stack.yaml", "criteria.yaml"))
    settings = RunSettings(
        channel=OtherPath(str(profile)), drive={"Ego": OtherPath(str(stack))}, criteria=OtherPath(str(criteria))
    )
    assert settings == RunSettings(channel=profile, drive={"Ego": stack}, criteria=criteria)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: run.variations(SCENARIO), "scenario is 'coop/scenario_1'; give the result of load_scenario"),  # type: ignore[arg-type]
        (lambda: run.check_scenario(SCENARIO, "road-link"), "ignored is 'road-link'; give a list of rules"),
        (lambda: v2x.build_channel("ideal", 1), "profile is 'ideal'; give the result of load_profile"),  # type: ignore[arg-type]
        (lambda: experiments.command_of(SCENARIO, 1, {"dt": 0.1}), r"settings is {'dt': 0.1}; give RunSettings"),  # type: ignore[arg-type]
        (lambda: experiments.command_of(SCENARIO, [1], BRIEF), r"the seed is \[1\]; give an integer"),  # type: ignore[arg-type]
        (lambda: pages.write_run_report([5], "page"), r"result is 5; .* such as RunResult.as_json\(\)"),  # type: ignore[list-item]
    ],
)
def test_object_of_a_related_kind_is_reported_with_the_expected_one(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize("lock", [common.write_atomically, common.exclusive])
def test_output_path_may_be_a_text(lock: Callable[..., AbstractContextManager[object]], tmp_path: Path) -> None:
    with lock(str(tmp_path / "out.txt")):
        assert any(tmp_path.iterdir())


def test_picture_with_another_suffix_is_reported(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="unknown format"):
        report.draw(SCENARIO).write(tmp_path / "picture.jpeg")
