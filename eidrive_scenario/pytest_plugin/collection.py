"""Scenario files as test items."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.library import definition
from eidrive_scenario.pytest_plugin.distributions import DistributionFile
from eidrive_scenario.pytest_plugin.options import Arm, arms, wanted
from eidrive_scenario.pytest_plugin.outcome import failure_text, judge


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


class ScenarioItem(pytest.Item):
    """A scenario with one channel and one seed: fails where a criterion fails or the run does not end by itself."""

    def __init__(self, *, arm: Arm, **named: Any) -> None:
        super().__init__(**named)
        self.arm = arm

    def runtest(self) -> None:
        """Play it and note its numbers. Raises ScenarioFailed, InputError."""
        judge(self, self.path, self.arm)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The verdict's reason, or file and line of a wrong input; a traceback for anything else."""
        return failure_text(excinfo.value) or super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[os.PathLike[str], int | None, str]:
        """Where a report points to."""
        return self.path, None, self.name
