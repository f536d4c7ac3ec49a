"""Example and numbers of docs/cooperative_perception.md."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.fusion.intermediate import IntermediateFusion
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame, split, to_cells

PAGE = (Path(__file__).parents[3] / "docs" / "cooperative_perception.md").read_text()


def example() -> str:
    match = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert match is not None
    return match[1]


def test_documented_method_has_at_most_thirty_lines() -> None:
    assert len(example().strip().splitlines()) <= 30


def test_documented_method_is_the_mean_of_present_features() -> None:
    names: dict[str, Any] = {"__name__": "documented"}
    exec(compile(example(), "cooperative_perception.md", "exec", dont_inherit=True), names)
    method: IntermediateFusion = names["MeanFusion"](names["MeanSettings"](own_weight=1.0))
    own = np.full((96, 1, 2), 3.0, np.float32)
    received = np.stack([own + 3.0, own + 6.0])
    present = np.array([[[True, True]], [[True, False]]])
    fused = method.fuse_maps(own, received, present)
    assert fused.dtype == np.float32
    np.testing.assert_allclose(fused[:, 0], np.tile([6.0, 4.5], (96, 1)))


def test_documented_sizes_and_airtimes() -> None:
    """Airtime of IEEE 802.11-2012: 40 µs, and symbols of 8 µs with 48 bits each; a frame has 22 bits more."""
    rows = re.findall(r"^\| .*? \| ([\d,]+) \| ([\d,]+) \| (\d+) \| ([\d.]+) ms \|$", PAGE, re.MULTILINE)
    assert len(rows) == 4
    for (*row, milliseconds), encoding in zip(rows, ["codes", "int8", "int8", "int8"], strict=True):
        cells, size, count = (int(number.replace(",", "")) for number in row)
        codes = np.zeros((8, cells), np.int8) if encoding == "int8" else np.zeros(cells, np.uint8)
        whole = FeatureFrame(
            0, 0, 0, 1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8, (128, 128), encoding, 1.0,  # type: ignore[arg-type]
            to_cells(np.arange(cells), codes),
        )  # fmt: skip
        frames = split(whole, 1400)
        sizes = [len(frame.encode()) for frame in frames]
        assert (sum(sizes), len(sizes)) == (size, count)
        airtime = sum(0.040 + 0.008 * math.ceil((8 * size + 22) / 48) for size in sizes)
        assert f"{airtime:.{1 if airtime < 10.0 else 0}f}" == milliseconds
