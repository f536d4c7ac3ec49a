"""Comparison of the values of an axis of one sweep, in pairs of runs with equal seeds."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive, eidrive

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.comparison import NamedComparison, compare, compare_values
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun

__all__ = ["eidrive"]

Verdicts = Mapping[Any, Sequence[bool | None]]
"""Verdicts of the seeds 1, 2, 3 … of each value; None is an aborted run."""
EXAMPLE = Path(__file__).parents[3] / "examples" / "fusion_comparison.md"


def store(path: Path, axis: str, verdicts: Verdicts, others: Sequence[int] = (0,)) -> Path:
    """Write a store with these verdicts for each value of a second axis `Other`; the gap is seed plus twice `Other`."""
    runs: list[StoredRun] = []
    for other in others:
        for value, passed in verdicts.items():
            for seed, verdict in enumerate(passed, 1):
                status = "aborted" if verdict is None else "passed" if verdict else "failed"
                result = {"passed": verdict, "gap": seed + 2.0 * other, "trace_hash": f"{seed}-{verdict}"}
                point = {axis: value, "Other": other}
                number = len(runs)
                row = {} if verdict is None else result
                runs.append(StoredRun(f"{path}{number}", number, "s", None, seed, status, point, row, "", "", 1.0))
    with ResultStore.open(path, {"eidrive-scenario": "1"}) as opened:
        opened.add(*runs)
    return path


def values_of(comparisons: Sequence[NamedComparison]) -> list[tuple[Any, Any]]:
    return [(one.first, one.second) for one in comparisons]


def test_values_of_an_axis_compare_as_two_stores(tmp_path: Path) -> None:
    """All statistics are those of two stores with one value each, over all values of the other axis."""
    verdicts: Verdicts = {"a": [True, True, False, None, True, False], "b": [True, False, True, True, True]}
    both = store(tmp_path / "both.db", "Fusion", verdicts, others=(3, 4))
    separate = [store(tmp_path / f"{name}.db", "Unused", {0: verdicts[name]}, others=(3, 4)) for name in verdicts]
    (between,) = compare_values([both], "Fusion", metrics=["gap"])
    expected = compare([separate[0]], [separate[1]], metrics=["gap"])
    assert (between.first, between.second) == ("a", "b")
    assert between.comparison is not None
    counts = between.comparison.verdicts
    assert (counts.both, counts.only_first, counts.only_second, counts.neither) == (4, 2, 2, 0)
    assert between.comparison == expected


def test_each_value_is_compared_with_the_first(tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Gap", {"late": [True], 10: [True], 9.5: [False], "early": [True]})
    assert values_of(compare_values([path], "Gap")) == [(9.5, 10), (9.5, "late"), (9.5, "early")]
    assert values_of(compare_values([path], "Gap", ["early", 10])) == [("early", 10)]
    assert values_of(compare_values([path], "param.Gap", [10, 9.50])) == [(10, 9.5)]


def test_texts_select_equal_texts_before_equal_numbers(tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Model", {"1.10": [True], "1.1": [True], 9.5: [False]})
    assert values_of(compare_values([path], "Model", ["1.10", "1.1"])) == [("1.10", "1.1")]
    assert values_of(compare_values([path], "Model", ["1.10", "9.50"])) == [("1.10", 9.5)]


def test_value_without_a_partner_has_no_comparison(tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Gap", {1: [True, False], 2: [None, None], 3: [None, True]})
    without, compared = compare_values([path], "Gap")
    assert without.comparison is None
    assert dict(without.counts) == {"aborted": 2}
    assert compared.comparison is not None
    assert (compared.comparison.verdicts.pairs, compared.comparison.lost) == (1, 1)


@pytest.mark.parametrize(
    ("axis", "values", "message"),
    [
        ("gap", [], "no axis 'gap'; did you mean 'Gap'?"),
        ("Gap", [1, 4], "no run has Gap=4; the runs have 1, 2"),
        ("Gap", [1, 1], "a value of Gap is given twice"),
        ("Gap", [2], "a single value of Gap cannot be compared .got 2.; the runs have 1, 2"),
        ("Other", [], "a single value of Other cannot be compared .got 0.; the runs have 0"),
        ("Gap", [1, 2], "no runs with a verdict are equal but for Gap"),
    ],
)
def test_values_that_cannot_be_compared_are_errors(tmp_path: Path, axis: str, values: list[Any], message: str) -> None:
    path = store(tmp_path / "s.db", "Gap", {1: [True, None], 2: [None, True]})
    with pytest.raises(SettingError, match=f"--between: {message}"):
        compare_values([path], axis, values)


def test_metric_is_an_error_only_if_no_value_has_it(tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Gap", {1: [True], 2: [None], 3: [True]})
    without, compared = compare_values([path], "Gap", metrics=["gap"])
    assert without.comparison is None
    assert compared.comparison is not None
    assert compared.comparison.metrics["gap"].mean == 0.0
    with pytest.raises(SettingError, match="--metric: no pair of runs has finite numbers 'gab'; known: gap"):
        compare_values([path], "Gap", metrics=["gab"])


def test_parameter_of_a_distribution_pairs_runs_with_equal_other_parameters(tmp_path: Path) -> None:
    """Runs 0 to 3 have speeds 5, 5, 9, 9 and gaps 1, 2, 1, 2: run 0 is compared with run 2, and run 1 with run 3."""
    parameters = [(5, 1), (5, 2), (9, 1), (9, 2)]
    passed = [True, False, True, True]
    settings = json.dumps({"varied": ["Speed", "Gap"]})
    runs = [
        StoredRun(
            str(number), number, "s", number, 1, "passed" if passed[number] else "failed", {"run": number},
            {"parameter.Speed": speed, "parameter.Gap": gap, "trace_hash": ""}, "", "", 1.0, settings,
        )
        for number, (speed, gap) in enumerate(parameters)
    ]  # fmt: skip
    path = tmp_path / "s.db"
    with ResultStore.open(path, {"eidrive-scenario": "1"}) as opened:
        opened.add(*runs)
    (one,) = compare_values([path], "Speed")
    assert one.comparison is not None
    counts = one.comparison.verdicts
    assert (counts.both, counts.only_first, counts.only_second, counts.neither) == (1, 0, 1, 0)


STRANGE = "a|b `x` <script>\n*y*"


def test_command_writes_text_json_markdown_and_page(eidrive: Eidrive, tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Gap", {"x": [True] * 4, STRANGE: [True, False, False, None], 2: [None]})
    page = tmp_path / "page.html"
    words = ("compare", path, "--between", "Gap=x,2", "--html", page)
    assert eidrive(*words).exit_code == 2
    done = eidrive("compare", path, "--between", "Gap", "--json", "--html", page)
    assert done.exit_code == 2  # 2 is the reference, and has no verdict
    verdicts: Verdicts = {"x": [True] * 4, STRANGE: [True, False, False, None], "z": [None]}
    path = store(tmp_path / "t.db", "Gap", verdicts)
    done = eidrive("compare", path, "--between", "Gap", "--json", "--html", page)
    assert done.exit_code == 1
    compared, without = map(json.loads, done.stdout.splitlines())
    assert without == {
        "axis": "Gap", "first": "x", "second": "z", "pairs": 0, "runs": {"aborted": 1}, "conclusion": "undecided",
    }  # fmt: skip
    assert (compared["second"], compared["pairs"], compared["only_first_passed"], compared["lost"]) == (
        STRANGE,
        3,
        2,
        1,
    )
    assert compared["difference"] == pytest.approx(-2 / 3)
    text = page.read_text(encoding="utf-8")
    assert "<script>\n" not in text
    assert "&lt;script&gt;" in text
    done = eidrive("compare", path, "--between", "Gap", "--markdown")
    rows = [line for line in done.stdout.splitlines() if line.startswith("|")]
    assert [row.replace(r"\|", "").count("|") for row in rows] == [10] * 4
    assert rows[2].startswith(r"| `` a\|b `x` <script> *y* `` | **undecided** | 3 | 100.0% | 33.3% | 2 | 0 | -66.7% (")
    assert rows[3].startswith("| `z` | **undecided** | 0 |")
    assert "no verdict of 1 run" in done.stdout
    assert "no run of z has a partner" in done.stdout
    done = eidrive("compare", path, "--between", "Gap")
    assert done.exit_code == 1
    assert done.stdout.splitlines()[0].startswith("Gap: A is x, B is a|b")
    assert "(runs of B: 1 aborted)" in done.stdout


def test_command_compares_two_stores_or_values_of_one(eidrive: Eidrive, tmp_path: Path) -> None:
    path = store(tmp_path / "s.db", "Gap", {1: [True], 2: [True]})
    done = eidrive("compare", path)
    assert done.exit_code == 2
    assert "the number of stores is 1; give two, or --between NAME" in " ".join(done.stderr.split())
    done = eidrive("compare", path, path, "--json")
    (one,) = map(json.loads, done.stdout.splitlines())
    assert (one["axis"], one["first"], one["second"], one["identical"]) == (None, str(path), str(path), 2)
    assert eidrive("compare", path, path, "--json", "--markdown").exit_code == 2
    assert eidrive("compare", path, path, "--html", path).exit_code == 2


@pytest.mark.process
def test_documented_comparison_of_fusion_methods_equals_that_of_two_folders(eidrive: Eidrive, tmp_path: Path) -> None:
    """The commands in the head of the example write its content; its statistics are those of runs without a sweep."""
    text = EXAMPLE.read_text(encoding="utf-8")
    sweep, comparison = re.findall(r"^\$ eidrive (.*?)(?: > .*)?$", text, re.MULTILINE)
    stores = [tmp_path / name for name in ("fusion.db", "average", "covariance_intersection")]
    assert eidrive(*sweep.replace("fusion.db", str(stores[0])).split(), "--workers", 2).exit_code == 0
    words = comparison.replace("fusion.db", str(stores[0])).split()
    assert eidrive(*words).stdout.strip() == text[text.index("###") :].strip()
    between = json.loads(eidrive(*(word.replace("--markdown", "--json") for word in words)).stdout)
    for folder in stores[1:]:
        options = ("--channel", "latency_300ms", "--fusion", folder.name, "--repeat", 6, "--record", "never")
        eidrive("run", "coop/scenario_1", *options, "--out", folder)
    metric = ("--metric", *between["metrics"])
    separate = json.loads(eidrive("compare", *stores[1:], *metric, "--json").stdout)
    names = {"axis": "fusion", "first": "average", "second": "covariance_intersection"}
    assert {**separate, **names} == between
