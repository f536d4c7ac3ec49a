"""Runs of scenarios as test items: an aborted run is an error, a failed verdict is a failure."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import ConstraintError
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.failure_text import (
    ScenarioFailed,
    explain_outcome,
    failure_text,
    failures_of,
    has_no_verdict,
)
from eidrive_scenario.pytest_plugin.markers import keywords, run_markers
from eidrive_scenario.pytest_plugin.outcome import run_file_and_report
from eidrive_scenario.pytest_plugin.run_records import add_error, add_failed_run
from eidrive_scenario.pytest_plugin.variants import RunVariant

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
            self._result = run_file_and_report(self, self.path, self.variant, self.run)
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
        for failure in failures_of(self._result):
            add_failed_run(self, failure, file)
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
