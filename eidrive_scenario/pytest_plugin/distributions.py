"""Parameter value distributions as test items: one for each concrete run, up to a maximum that is reported."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.pytest_plugin.items import ScenarioItem
from eidrive_scenario.pytest_plugin.markers import test_name
from eidrive_scenario.pytest_plugin.options import max_runs
from eidrive_scenario.pytest_plugin.variants import run_variants

if TYPE_CHECKING:
    from eidrive_scenario.openscenario import ConcreteRun

_LEFT_OUT = pytest.StashKey[dict[str, list[int]]]()
"""Number of tests and number of runs of each file with omitted runs, by node id."""
_WORKER_KEY = "eidrive_left_out"
_MAX_LENGTH = 100
"""Maximum number of characters of a run in the name of its test."""


class DistributionFile(pytest.File):
    """`.xosc` file that expands to concrete runs of a scenario."""

    def collect(self) -> Iterable[ScenarioItem]:
        """Yield one item per run, channel and seed. Raise CollectError if the distribution is invalid."""
        from eidrive_scenario.openscenario import load_distribution

        try:
            runs = load_distribution(self.path)
        except InputError as error:
            raise self.CollectError(str(error)) from error
        most = max_runs(self.config)
        numbers = range(len(runs)) if most is None else runs.spread(most)
        if len(numbers) < len(runs):
            self.config.stash.setdefault(_LEFT_OUT, {})[self.nodeid] = [len(numbers), len(runs)]
        for number in numbers:
            run = runs[number]
            for variant in run_variants(self.config):
                name = f"{test_name(self.config, self.path)}[{_run_name(run)}-{variant}]"
                yield ScenarioItem.from_parent(self, name=name, run=run, variant=variant)


def _run_name(run: ConcreteRun) -> str:
    """Return the number of the run, which is unique, and its parameters, which are truncated."""
    parts = (f"{name}={PurePosixPath(text).name or text}" for name, text in run.parameters.items())
    values = re.sub(r"[\s\[\]:]+", "_", "-".join(parts))
    values = values if len(values) <= _MAX_LENGTH else values[: _MAX_LENGTH - 1] + "…"
    return f"run={run.number}-{values}" if values else f"run={run.number}"


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Merge the omitted runs of a worker of pytest-xdist: workers collect, and the controller reports."""
    left_out = getattr(node, "workeroutput", {}).get(_WORKER_KEY, {})
    node.config.stash.setdefault(_LEFT_OUT, {}).update(left_out)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Send the omitted runs from a worker of pytest-xdist to the controller."""
    workeroutput = getattr(session.config, "workeroutput", None)
    if workeroutput is not None:
        workeroutput[_WORKER_KEY] = session.config.stash.get(_LEFT_OUT, {})


def show_left_out(terminalreporter: Any, config: pytest.Config) -> None:
    """Report the distributions with more runs than tests."""
    left_out = config.stash.get(_LEFT_OUT, {})
    if not left_out:
        return
    terminalreporter.section("omitted runs", sep="-", yellow=True)
    for node, (tests, runs) in sorted(left_out.items()):
        terminalreporter.line(f"{node}: {tests} of {runs} runs are tests, {runs - tests} are omitted")
    terminalreporter.line("--eidrive-max-runs N selects more of them, --eidrive-max-runs all selects all")
