"""Collection of scenario files as pytest items."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from openscenario_xml import catalog_xml

pytest_plugins = ["pytester"]

FIRST = "data/first.xosc::data/first[seed=1]"
SECOND = "data/second.xosc::data/second[seed=1]"
PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """Return a third-party project: Python tests, and a folder with two scenarios and a catalog."""
    pytester.makepyfile(test_own="def test_own():\n    pass")
    data = pytester.mkdir("data")
    for name in ("one", "two"):
        (pytester.mkdir(name) / "bad.yaml").write_text("loss: {kind: bernoulli, probability: 0.9}")
    for name in ("first", "second"):
        shutil.copy(PASSING_BY, data / f"{name}.xosc")
    (data / "cars.xosc").write_bytes(catalog_xml("cars", ""))
    (data / "other.xosc").write_text("<somethingElse/>")
    return pytester


def collected(pytester: pytest.Pytester, *arguments: str) -> list[str]:
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", *arguments)
    return [line for line in result.outlines if "::" in line]


def test_collection_without_arguments_ignores_scenarios(project: pytest.Pytester) -> None:
    assert collected(project) == ["test_own.py::test_own"]


def test_collection_of_link_to_folder_finds_its_scenarios(project: pytest.Pytester) -> None:
    (project.path / "link").symlink_to(project.path / "data")
    assert len(collected(project, "link")) == 2


def test_collection_of_folder_finds_its_scenarios(project: pytest.Pytester) -> None:
    assert collected(project, "data") == [FIRST, SECOND]


def test_collection_of_file_and_node_id_finds_them(project: pytest.Pytester) -> None:
    assert collected(project, "data/first.xosc") == [FIRST]
    item = "data/first.xosc::data/first[channel=none-seed=2]"
    assert collected(project, item, "--eidrive-channel", "ideal,none", "--eidrive-seeds", "2") == [item]


def test_collection_of_other_file_ignores_scenarios(project: pytest.Pytester) -> None:
    assert collected(project, "test_own.py") == ["test_own.py::test_own"]


def test_eidrive_paths_option_selects_folders(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_paths = scenarios")
    scenarios = project.mkdir("scenarios")
    shutil.copy(PASSING_BY, scenarios / "third.xosc")
    assert collected(project) == ["scenarios/third.xosc::scenarios/third[seed=1]", "test_own.py::test_own"]
    assert collected(project, "data") == []
    assert collected(project, "data/first.xosc") == [FIRST]


def test_eidrive_paths_option_with_missing_folder_is_usage_error(project: pytest.Pytester) -> None:
    project.makeini("[pytest]\neidrive_paths = no such")
    result = project.runpytest("--collect-only")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: ini option eidrive_paths: no folder '*no'; quote a path with spaces"])


def test_collection_yields_one_item_per_channel_and_seed(project: pytest.Pytester) -> None:
    items = collected(project, "data/first.xosc", "--eidrive-channel", "ideal,one/bad.yaml", "--eidrive-seeds", "2")
    assert [item.split("::")[1] for item in items] == [
        "data/first[channel=ideal-seed=1]",
        "data/first[channel=ideal-seed=2]",
        "data/first[channel=bad-seed=1]",
        "data/first[channel=bad-seed=2]",
    ]


def test_keyword_option_selects_items(project: pytest.Pytester) -> None:
    items = collected(project, "data", "--eidrive-seeds", "3", "-k", "second and seed:3")
    assert items == ["data/second.xosc::data/second[seed=3]"]


def test_seeds_option_of_zero_is_usage_error(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess("data", "--eidrive-seeds", "0")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--eidrive-seeds: not a positive integer (got '0')"])


@pytest.mark.parametrize("channels", ["", " ,"])
def test_channel_option_without_channel_is_usage_error(project: pytest.Pytester, channels: str) -> None:
    result = project.runpytest_inprocess("data", f"--eidrive-channel={channels}")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*--eidrive-channel: no channel is listed (got {channels!r})"])


def test_channel_option_accepts_inline_profile_and_drops_duplicates(project: pytest.Pytester) -> None:
    channels = "ideal, {delay: {kind: uniform, low: 0, high: 0.1}, loss: {kind: none}},ideal,none,"
    items = collected(project, "data/first.xosc", "--eidrive-channel", channels)
    assert [item.split("::")[1] for item in items] == [
        "data/first[channel=ideal-seed=1]",
        "data/first[channel=delay_kind_uniform_low_0_high_0.1_loss_kind_none-seed=1]",
        "data/first[channel=none-seed=1]",
    ]


def test_channel_option_is_repeatable(project: pytest.Pytester) -> None:
    items = collected(project, "data/first.xosc", "--eidrive-channel", "ideal", "--eidrive-channel", "none,ideal")
    assert [item.split("::")[1] for item in items] == [
        "data/first[channel=ideal-seed=1]",
        "data/first[channel=none-seed=1]",
    ]


@pytest.mark.process
def test_collection_without_arguments_under_xdist_ignores_scenarios(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess("-n", "1", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=1)


def test_item_names_of_channels_with_equal_names_differ(project: pytest.Pytester) -> None:
    """Two folders have a profile `bad`, and two inline profiles are equal in their first 80 characters."""
    inline = "{delay: {kind: uniform, low: 0.000000000000, high: 0.100000000000}, loss: {kind: none}, reordering: "
    channels = f"one/bad.yaml,two/bad.yaml,{inline}true}},{inline}false}}"
    items = collected(project, "data/first.xosc", "--eidrive-channel", channels)
    names = [item.split("::")[1] for item in items]
    assert names[:2] == ["data/first[channel=bad-seed=1]", "data/first[channel=bad_2-seed=1]"]
    assert len(set(names)) == 4
