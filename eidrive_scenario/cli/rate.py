"""Option `--success-rate` of `eidrive run`."""

from __future__ import annotations

import json as json_text
from collections.abc import Sequence

from eidrive_scenario.cli.streams import echo
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.exit_codes import FAILED, PASSED
from eidrive_scenario.experiments.statistics.intervals import anytime_interval
from eidrive_scenario.experiments.statistics.sequential import LIMIT, Decision, RatioTest
from eidrive_scenario.experiments.statistics.sequential import success_rate as test_of_rate
from eidrive_scenario.experiments.success_rate import decision_text


def rate_test(at_least: float, confidence: float, repeat: int) -> RatioTest:
    """Return the test of a required rate; `repeat` above 1 is its limit. Raise SettingError for invalid options."""
    try:
        return test_of_rate(at_least, confidence=confidence, limit=repeat if repeat > 1 else LIMIT)
    except ValueError as error:
        if "confidence" in str(error):
            raise SettingError(
                Diagnostic(f"--confidence is {confidence}", "give a number between 0.5 and 1")
            ) from error
        raise SettingError(Diagnostic(f"--success-rate is {at_least}", "give a rate between 0 and 1")) from error


def decision_code(test: RatioTest, codes: Sequence[int], *, json: bool) -> int | None:
    """Return the exit code of the test after runs with these exit codes, and print the decision; None before it.

    A run that was aborted or invalid ends the test with its code. An undecided test has the code of a failed one.
    """
    others = [code for code in codes if code not in (PASSED, FAILED)]
    if others:
        return max(others)
    passed = sum(code == PASSED for code in codes)
    decision = test.decision(passed, len(codes))
    if decision is None:
        return None
    rate = anytime_interval(passed, len(codes), 1.0 - test.false_pass)
    if json:
        found = {"at_least": test.bad, "decision": str(decision), "passed": passed, "runs": len(codes)}
        echo(json_text.dumps({"success_rate": {**found, "low": rate.low, "high": rate.high}}))
    else:
        echo(decision_text(test, decision, rate))
    return PASSED if decision is Decision.PASSED else FAILED
