"""Comparison of two sweeps with equal seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive
from msgspec.structs import replace

from eidrive_scenario.errors import SettingError
from eidrive_scenario.experiments.sweeps.comparison import compare
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun

__all__ = ["eidrive"]


def store(path: Path, version: str, passed: Sequence[bool | None], shift: float = 0.0) -> Path:
    """Write a store with one run per verdict; None is an aborted run."""
    with ResultStore.open(path, {"eidrive-scenario": version}) as opened:
        for seed, verdict in enumerate(passed, 1):
            status = "aborted" if verdict is None else "passed" if verdict else "failed"
            result = {"passed": verdict, "gap": seed + shift, "trace_hash": f"{seed}-{verdict}"}
            key = f"{version}-{seed}"
            opened.add(
                StoredRun(
                    key, seed, "s", None, seed, status, {"Speed": 5}, result if verdict is not None else {}, "", "", 1
                )
            )
    return path


def test_compare_counts_pairs_by_identity_across_versions(tmp_path: Path) -> None:
    """Keys differ between versions; runs are paired by scenario, seed and values."""
    first = store(tmp_path / "a.db", "1", [True, True, False, None, True])
    second = store(tmp_path / "b.db", "2", [True, False, True, True, True, False], shift=0.5)
    found = compare([first], [second], metrics=["gap"])
    counts = found.verdicts
    assert (counts.both, counts.only_first, counts.only_second, counts.neither) == (2, 1, 1, 0)
    assert found.unpaired == 2
    assert found.identical == 2
    assert found.metrics["gap"].mean == pytest.approx(0.5)
    assert found.metrics["gap"].low == found.metrics["gap"].high == pytest.approx(0.5)
    assert not found.is_not_worse
    assert not found.is_worse


@pytest.mark.process
@pytest.mark.parametrize(
    ("second", "code", "expected"),
    [
        ([True] * 190 + [False] * 10, 0, "B is not worse than A by 5.0% or more"),
        ([True] * 150 + [False] * 50, 1, "B is worse than A"),
        ([False] * 12 + [True] * 184 + [False] * 4, 1, "undecided"),
        ([True] * 180 + [None] * 10 + [False] * 10, 1, "undecided: B has no verdict of 10 runs with a verdict in A"),
    ],
)
def test_compare_command_decides_by_exit_code(
    eidrive: Eidrive, tmp_path: Path, second: list[bool | None], code: int, expected: str
) -> None:
    first = store(tmp_path / "a.db", "1", [True] * 190 + [False] * 10)
    done = eidrive("compare", first, store(tmp_path / "b.db", "2", second))
    assert done.exit_code == code
    assert done.stdout.splitlines()[-1].startswith(expected)


def test_compare_without_common_runs_raises(tmp_path: Path) -> None:
    first = store(tmp_path / "a.db", "1", [True, True])
    second = store(tmp_path / "b.db", "2", [None, None, True])
    with pytest.raises(SettingError, match="in common"):
        compare([first], [second])


def test_compare_omits_pairs_with_infinite_values(tmp_path: Path) -> None:
    """A gap of infinity is no measurement; the other pair differs by 0.5."""
    first, second = store(tmp_path / "a.db", "1", [True, True]), store(tmp_path / "b.db", "2", [True, True], shift=0.5)
    with ResultStore.open(first, {"eidrive-scenario": "1"}) as opened:
        run = next(opened.runs())
        opened.add(replace(run, result={**run.result, "gap": math.inf}))
    found = compare([first], [second], metrics=["gap"]).metrics["gap"]
    assert found.pairs == 1
    assert found.mean == pytest.approx(0.5)


def test_compare_command_states_intervals_of_metrics(eidrive: Eidrive, tmp_path: Path) -> None:
    """Gaps 1, 2, 3 and 1, 2, 6: differences 0, 0, 3 with mean 1 and standard deviation sqrt(3), so 1 ± 4.303.

    A single pair has no interval.
    """
    first, second = (store(tmp_path / f"{name}.db", name, [True] * 3) for name in "ab")
    with ResultStore.open(second, {"eidrive-scenario": "b"}) as opened:
        run = list(opened.runs())[-1]
        opened.add(replace(run, result={**run.result, "gap": 6.0}))
    done = eidrive("compare", first, second, "--metric", "gap")
    assert "gap: B - A +1 (95%: -3.303 to +5.303; 3 pairs)" in done.stdout
    alone = [store(tmp_path / f"{name}.db", name, [True]) for name in "cd"]
    done = eidrive("compare", *alone, "--metric", "gap")
    assert "gap: B - A +0 (95%: no interval, too few values; 1 pair)" in done.stdout


def test_compare_with_unknown_metric_names_known_ones(tmp_path: Path) -> None:
    first, second = (store(tmp_path / f"{name}.db", name, [True]) for name in "ab")
    with pytest.raises(SettingError, match="known: gap"):
        compare([first], [second], metrics=["gab"])


@pytest.mark.parametrize("option", [("--margin", "1"), ("--margin", "-0.1"), ("--confidence", "0.4")])
def test_compare_with_invalid_options_is_error(eidrive: Eidrive, tmp_path: Path, option: tuple[str, str]) -> None:
    first, second = (store(tmp_path / f"{name}.db", name, [True]) for name in "ab")
    done = eidrive("compare", first, second, *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
