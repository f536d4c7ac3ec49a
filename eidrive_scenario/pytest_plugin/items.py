"""Scenario files and their runs as tests: an aborted run is an error, a failed verdict is a failure."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import ConstraintError, InputError
from eidrive_scenario.extensions.library import definition
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.failures import (
    ScenarioFailed,
    add_error,
    add_failures,
    add_properties,
    explain_outcome,
    failure_text,
    has_no_verdict,
)
from eidrive_scenario.pytest_plugin.markers import keywords, run_markers, test_name
from eidrive_scenario.pytest_plugin.options import is_selected, max_runs
from eidrive_scenario.pytest_plugin.outcome import run_and_report
from eidrive_scenario.pytest_plugin.variants import RunVariant, run_variants

if TYPE_CHECKING:
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.openscenario import ConcreteRun
    from eidrive_scenario.simulation import RunResult


class ScenarioItem(pytest.Item):
    """Test item of one run of a scenario, with one channel and one seed.

    The run is the setup of the test, and its verdict is the test. An invalid file, an exception of an extension, a
    run beyond its limit of wall time or simulated time and one without criteria are therefore errors, which pytest and
    JUnit report separately from failures.

    run  concrete run of a parameter value distribution; skipped if it violates the constraints of the scenario
    """

    def __init__(self, *, variant: RunVariant, run: ConcreteRun | None = None, **named: Any) -> None:
        # The text is parsed into name and parameters, as pytest does with the ids that it stores for --lf.
        super().__init__(nodeid=f"{named['parent'].nodeid}::{named['name']}", **named)
        self.variant = variant
        self.run = run
        self._result: RunResult | RateVerdict | None = None
        number = None if run is None else run.number
        for marker in run_markers(self.config, self.path, variant.selectors, number):
            self.add_marker(marker)
        self.extra_keyword_matches.update(keywords(variant.selectors, number))

    def setup(self) -> None:
        """Run the scenario and record its properties. Raise a pytest exception with the diagnostics of an error."""
        if self.config.getoption("setuponly"):
            return
        try:
            self._result = run_and_report(self, self.run or self.path, self.variant, file=self.path)
            if self.run is not None:
                parameters = self.run.parameters.items()
                add_properties(self, [(f"parameter.{name}", value) for name, value in parameters])
        except ConstraintError as error:
            if self.run is None:
                add_error(self, error, self.path)
                raise pytest.fail.Exception(printable(str(error)), pytrace=False) from None
            pytest.skip(printable(f"excluded by constraints: {error}"))
        except Exception as error:
            add_error(self, error, self.path)
            text = failure_text(error)
            if text is None:
                raise
            raise pytest.fail.Exception(text, pytrace=False) from None
        file = self.path if self.run is None else self.run.scenario
        add_failures(self, self._result, file)
        if has_no_verdict(self._result):
            raise pytest.fail.Exception(explain_outcome(self._result), pytrace=False)

    def runtest(self) -> None:
        """Raise ScenarioFailed if a criterion failed, or the success rate is not shown."""
        if self._result is not None and not self._result.passed:
            raise ScenarioFailed(self._result)

    def teardown(self) -> None:
        """Release the result: a session holds its items until it ends."""
        self._result = None

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the reason of the verdict, or a traceback for any other exception."""
        return failure_text(excinfo.value) or super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[os.PathLike[str], int | None, str]:
        """Return the location that reports name."""
        return self.path, None, self.name


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
            name = f"{test_name(self.config, self.path, all_folders=False)}[{variant}]"
            yield ScenarioItem.from_parent(self, name=name, variant=variant)


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
                name = f"{test_name(self.config, self.path, all_folders=False)}[{_run_name(run)}-{variant}]"
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
