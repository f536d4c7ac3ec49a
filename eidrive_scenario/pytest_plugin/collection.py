"""Scenario files as test items."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from eidrive_scenario.library import definition
from eidrive_scenario.pytest_plugin.distributions import DistributionFile
from eidrive_scenario.pytest_plugin.items import ScenarioItem
from eidrive_scenario.pytest_plugin.markers import test_name
from eidrive_scenario.pytest_plugin.options import is_selected
from eidrive_scenario.pytest_plugin.variants import run_variants


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.File | None:
    """Collect a selected scenario or parameter value distribution. Catalogs are not collected."""
    if file_path.suffix != ".xosc" or not is_selected(parent.config, file_path):
        return None
    kind = definition(file_path)
    if kind not in ("scenario", "distribution", "unreadable"):
        return None
    file: pytest.File = (DistributionFile if kind == "distribution" else ScenarioFile).from_parent(
        parent, path=file_path
    )
    return file


class ScenarioFile(pytest.File):
    """`.xosc` file, which is read when its tests run."""

    def collect(self) -> Iterable[ScenarioItem]:
        """Yield one item per channel and seed."""
        for variant in run_variants(self.config):
            name = f"{test_name(self.config, self.path)}[{variant}]"
            yield ScenarioItem.from_parent(self, name=name, variant=variant)
