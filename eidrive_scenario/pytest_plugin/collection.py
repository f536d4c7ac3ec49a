"""Scenario files as test items."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from eidrive_scenario.library import definition
from eidrive_scenario.pytest_plugin.distributions import DistributionFile
from eidrive_scenario.pytest_plugin.items import ScenarioItem
from eidrive_scenario.pytest_plugin.options import arms, wanted


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.File | None:
    """A scenario or a distribution of parameter values that was asked for; catalogs are neither."""
    if file_path.suffix != ".xosc" or not wanted(parent.config, file_path):
        return None
    kind = definition(file_path)
    if kind not in ("scenario", "distribution", "unreadable"):
        return None
    file: pytest.File = (DistributionFile if kind == "distribution" else ScenarioFile).from_parent(
        parent, path=file_path
    )
    return file


class ScenarioFile(pytest.File):
    """A `.xosc` file; it is read when its tests run."""

    def collect(self) -> Iterable[ScenarioItem]:
        """One item per channel and seed."""
        for arm in arms(self.config):
            yield ScenarioItem.from_parent(self, name=f"{self.path.stem}[{arm}]", arm=arm)
