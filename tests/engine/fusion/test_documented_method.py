"""Example of docs/fusion.md."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.fusion.method import FusionMethod, Report

PAGE = Path(__file__).parents[3] / "docs" / "fusion.md"


def example() -> str:
    found = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    return found[1]


def test_documented_method_has_at_most_thirty_lines() -> None:
    assert len(example().strip().splitlines()) <= 30


def test_documented_method_fuses_newest_reports(report: Callable[..., Report]) -> None:
    names: dict[str, Any] = {}
    exec(compile(example(), str(PAGE), "exec"), names)
    method: FusionMethod = names["Newest"]()
    old = report("A", 0.0, [(0.0, 0.0), (20.0, 0.0)])
    new = report("B", 0.5, [(3.0, 0.0), (40.0, 0.0), (42.0, 0.0)])
    fused = method.fuse([old, new], 0.6)
    assert fused.time == 0.6
    np.testing.assert_array_equal(fused.boxes[:, 0], [3.0, 40.0, 42.0, 20.0])
    assert fused.classes == ("car",) * 4
    assert len(method.fuse([], 0.6)) == 0
