"""Selection of runs: expressions of -k and -m, markers, last failures, unusual names."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

pytestmark = pytest.mark.timeout(600)

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """Return a project with two folders of scenarios, and markers that must be declared."""
    pytester.makeini("[pytest]\naddopts = --strict-markers\neidrive_slow =\n    xosc/far/*\n")
    for name in ("near", "far"):
        folder = pytester.path / "xosc" / name
        folder.mkdir(parents=True)
        shutil.copy(PASSING_BY, folder / "drive.xosc")
    return pytester


def collected(pytester: pytest.Pytester, *arguments: str) -> list[str]:
    result = pytester.runpytest_inprocess("--collect-only", "-q", "-p", "no:cacheprovider", *arguments)
    assert result.ret in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
    return [line.partition("::")[2] for line in result.outlines if "::" in line]


CHANNELS = ("xosc", "--eidrive-channel", "ideal,latency_300ms", "--eidrive-seeds", "12")


def test_keyword_expression_selects_channel_and_exact_seed(project: pytest.Pytester) -> None:
    near = collected(project, *CHANNELS, "-k", "near and latency_300ms and seed:12")
    assert near == ["near/drive[channel=latency_300ms-seed=12]"]
    assert len(collected(project, *CHANNELS, "-k", "channel:ideal")) == 24


def test_marker_expression_selects_folder_and_settings(project: pytest.Pytester) -> None:
    """`seed=1` does not match 10 to 12, unlike a keyword."""
    seeds = collected(project, *CHANNELS, "-m", "near and scenario(channel='ideal', seed=1)")
    assert seeds == ["near/drive[channel=ideal-seed=1]"]
    assert len(collected(project, *CHANNELS, "-m", "slow")) == 24
    assert collected(project, "xosc", "-m", "not slow") == ["near/drive[seed=1]"]


def test_success_rate_has_marker_slow(project: pytest.Pytester) -> None:
    items = collected(project, "xosc", "--eidrive-success-rate", "0.9", "-m", "slow and near")
    assert items == ["near/drive[rate=0.9]"]


def test_files_of_equal_folder_and_name_are_named_by_all_folders(project: pytest.Pytester) -> None:
    """A further file does not rename the tests of the others."""
    project.makepyfile(
        """
        import pytest

        @pytest.mark.scenario("xosc/**/drive.xosc")
        def test_drive(run_scenario):
            run_scenario()
        """
    )
    expected = {"test_drive[far/drive-seed=1]", "test_drive[xosc/near/drive-seed=1]"}
    for town in ("a", "b", "0"):
        shutil.copytree(project.path / "xosc" / "near", project.path / "xosc" / town / "near")
        expected.add(f"test_drive[xosc/{town}/near/drive-seed=1]")
        names = collected(project, "test_files_of_equal_folder_and_name_are_named_by_all_folders.py")
        assert set(names) == expected


def test_files_that_differ_in_replaced_characters_have_hashes_of_their_paths(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.mark.scenario("xosc/near/a*.xosc")
        def test_drive(run_scenario):
            run_scenario()
        """
    )
    expected = set()
    for name in ("a_b", "a b", "a!b"):
        shutil.copy(PASSING_BY, project.path / f"xosc/near/{name}.xosc")
        digest = hashlib.sha256(f"xosc/near/{name}.xosc".encode()).hexdigest()[:8]
        expected.add(f"test_drive[xosc/near/a_b-{digest}-seed=1]")
    assert set(collected(project)) == expected


def test_keyword_expression_selects_settings_of_python_tests(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("other", [1, 2])
        @pytest.mark.scenario("xosc/near/drive", channel=["none", "ideal"], seeds=3)
        def test_marked(run_scenario, other):
            pass

        def test_unmarked(run_scenario):
            pass
        """
    )
    assert len(collected(project, "-k", "channel:ideal and seed:3")) == 2
    assert len(collected(project, "-k", "not seed:3")) == 9


def test_python_test_has_marker_of_folder(project: pytest.Pytester) -> None:
    project.makepyfile(
        """
        import pytest

        @pytest.mark.scenario("xosc/*/drive", seeds=2)
        def test_own(run_scenario):
            pass
        """
    )
    assert collected(project, "-m", "far and scenario(seed=2)") == ["test_own[far/drive-seed=2]"]


def test_folder_named_like_effective_marker_has_no_marker(project: pytest.Pytester) -> None:
    """A folder `skip` must not skip its runs."""
    for name in ("skip", "_private", "slow", "and"):
        shutil.copytree(project.path / "xosc" / "near", project.path / "more" / name)
    assert len(collected(project, "more")) == 4
    assert collected(project, "more", "-m", "skip") == []
    assert collected(project, "more", "-m", "slow") == ["slow/drive[seed=1]"]


@pytest.mark.process
def test_names_with_spaces_and_brackets_run(project: pytest.Pytester) -> None:
    """The name of the test has no space and no bracket but those of the settings."""
    folder = project.mkdir("my [odd] folder")
    shutil.copy(PASSING_BY, folder / "cut in [2], ü.xosc")
    shutil.copy(PASSING_BY, folder / "cut in.xosc")
    assert collected(project, ".", "-k", "odd") == [
        "my_odd_folder/cut_in_2_,_ü[seed=1]",
        "my_odd_folder/cut_in[seed=1]",
    ]
    result = project.runpytest_inprocess(".", "-m", "my_odd_folder", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=2, deselected=2)


def test_same_file_twice_is_one_test(project: pytest.Pytester) -> None:
    assert collected(project, "xosc/near/drive.xosc", "xosc/near/drive.xosc") == ["near/drive[seed=1]"]
    assert collected(project, "xosc/near", "xosc/near/drive.xosc") == ["near/drive[seed=1]"]


def test_empty_folder_has_no_tests(project: pytest.Pytester) -> None:
    result = project.runpytest_inprocess(str(project.mkdir("empty")), "-p", "no:cacheprovider")
    assert result.ret == pytest.ExitCode.NO_TESTS_COLLECTED


@pytest.mark.process
def test_last_failures_of_workers_run_again(project: pytest.Pytester) -> None:
    """A scenario that is corrected between two sessions passes in the second one."""
    path = project.path / "xosc" / "near" / "drive.xosc"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('value="5.0"', 'value="0.0"'), encoding="utf-8")
    project.runpytest_inprocess("xosc", "-n", "2").assert_outcomes(passed=1, failed=1)
    again = project.runpytest_inprocess("xosc", "--lf", "-v", "-n", "2")
    again.assert_outcomes(failed=1)
    path.write_text(text, encoding="utf-8")
    again = project.runpytest_inprocess("xosc", "--lf", "-v", "-p", "no:xdist")
    again.assert_outcomes(passed=1)
    again.stdout.fnmatch_lines(["*near/drive?seed=1? PASSED*"])
