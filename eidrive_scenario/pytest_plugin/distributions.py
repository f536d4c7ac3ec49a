"""Parameter value distributions as test items: one for each concrete run, up to a bound that is told."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.pytest_plugin.items import ScenarioItem
from eidrive_scenario.pytest_plugin.options import arms

if TYPE_CHECKING:
    from eidrive_scenario.openscenario import ConcreteRun

_LEFT_OUT = pytest.StashKey[dict[str, list[int]]]()
"""By the file's node: how many of its runs are tests, and how many there are."""
_WORKER_KEY = "eidrive_left_out"
_LONGEST = 100
"""Characters of a run in the name of its test."""


class DistributionFile(pytest.File):
    """A `.xosc` file that unfolds into concrete runs of a scenario."""

    def collect(self) -> Iterable[ScenarioItem]:
        """One item per run, channel and seed. Raise CollectError if the distribution is wrong."""
        from eidrive_scenario.openscenario import load_distribution

        try:
            runs = load_distribution(self.path)
        except InputError as error:
            raise self.CollectError(str(error)) from error
        most: int | None = self.config.getoption("eidrive_max_runs")
        numbers = range(len(runs)) if most is None else runs.spread(most)
        if len(numbers) < len(runs):
            self.config.stash.setdefault(_LEFT_OUT, {})[self.nodeid] = [len(numbers), len(runs)]
        for number in numbers:
            run = runs[number]
            for arm in arms(self.config):
                yield ScenarioItem.from_parent(self, name=f"{self.path.stem}[{_named(run)}-{arm}]", run=run, arm=arm)


def _named(run: ConcreteRun) -> str:
    """The run's number, which alone tells it from any other, and its parameters as far as they are short."""
    values = re.sub(r"[\s\[\]:]+", "_", str(run))
    values = values if len(values) <= _LONGEST else values[: _LONGEST - 1] + "…"
    return f"run{run.number}-{values}" if values else f"run{run.number}"


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take over what a worker of pytest-xdist has left out: they collect, their controller tells."""
    left_out = getattr(node, "workeroutput", {}).get(_WORKER_KEY, {})
    node.config.stash.setdefault(_LEFT_OUT, {}).update(left_out)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand what was left out to the controller, where this is a worker of pytest-xdist."""
    workeroutput = getattr(session.config, "workeroutput", None)
    if workeroutput is not None:
        workeroutput[_WORKER_KEY] = session.config.stash.get(_LEFT_OUT, {})


def show_left_out(terminalreporter: Any, config: pytest.Config) -> None:
    """Say which distributions have more runs than tests."""
    left_out = config.stash.get(_LEFT_OUT, {})
    if not left_out:
        return
    terminalreporter.section("runs left out", sep="-", yellow=True)
    for node, (tests, runs) in sorted(left_out.items()):
        terminalreporter.line(f"{node}: {tests} of {runs} runs are tests, {runs - tests} are left out")
    terminalreporter.line("--eidrive-max-runs N takes more of them, --eidrive-max-runs all takes all")
