"""Fixtures that write distribution files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from openscenario_xml import distribution_xml


@pytest.fixture
def distribution_file(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a distribution file with the given body from line 5 on."""

    def write(body: str, *, minor: int = 3) -> Path:
        (tmp_path / "scenario.xosc").touch()
        path = tmp_path / "distribution.xosc"
        path.write_bytes(distribution_xml(body, minor=minor))
        return path

    return write


@pytest.fixture
def stochastic(distribution_file: Callable[..., Path]) -> Callable[..., Path]:
    """Return a function that writes a distribution file that draws the parameter P."""

    def write(distribution: str, *, runs: int = 1000, seed: str = 'randomSeed="1"') -> Path:
        return distribution_file(
            f'<Stochastic numberOfTestRuns="{runs}" {seed}>\n'
            f'<StochasticDistribution parameterName="P">\n{distribution}\n</StochasticDistribution></Stochastic>'
        )

    return write
