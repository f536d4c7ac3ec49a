"""Verdict on a success rate: runs with consecutive seeds until a sequential test decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from eidrive_scenario.errors import ABORTED, NOT_JUDGED, SimulationError, counted
from eidrive_scenario.experiments.commands import reproduction_lines
from eidrive_scenario.experiments.statistics.intervals import Proportion, anytime_interval, exact_percentage, percentage
from eidrive_scenario.experiments.statistics.sequential import Decision, RatioTest
from eidrive_scenario.simulation import RunResult


@dataclass(frozen=True)
class RateVerdict:
    """Verdict on a success rate.

    decision   passed, failed, or undecided at the limit of the test
    rate       passed runs among all, with the interval of a confidence sequence
    failures   runs that did not pass
    """

    test: RatioTest
    decision: Decision
    rate: Proportion
    failures: tuple[RunResult, ...]

    @property
    def passed(self) -> bool:
        """Whether the runs show the required rate."""
        return self.decision is Decision.PASSED

    def __str__(self) -> str:
        """Return the verdict in one line."""
        return decision_text(self.test, self.decision, self.rate)


def decision_text(test: RatioTest, decision: Decision, rate: Proportion) -> str:
    """Return the decision of a test of a required rate in one line."""
    share, low, high = map(percentage, (rate.share, rate.low, rate.high))
    runs = f"{rate.successes} of {counted(rate.trials, 'run')} passed: {share}, {low} to {high}"
    required, confidence = exact_percentage(test.bad, 1), exact_percentage(1.0 - test.false_pass)
    return f"success rate of at least {required} with a confidence of {confidence}: {decision} ({runs})"


def decide_rate(run: Callable[[int], RunResult], test: RatioTest) -> RateVerdict:
    """Return the verdict on the success rate of a run, which is called with the seeds 1, 2, 3 …

    An exception of a run ends the test. Raise SimulationError for a run without a verdict: it ended at its time limit
    before a criterion failed, or no criterion judges it.
    """
    failures: list[RunResult] = []
    trials = 0
    decision = None
    while decision is None:
        result = run(1 + trials)
        if result.exit_code in (ABORTED, NOT_JUDGED):
            raise _without_verdict(result)
        trials += 1
        if not result.passed:
            failures.append(result)
        decision = test.decision(trials - len(failures), trials)
    rate = anytime_interval(trials - len(failures), trials, 1.0 - test.false_pass)
    return RateVerdict(test, decision, rate, tuple(failures))


def _without_verdict(result: RunResult) -> SimulationError:
    is_unjudged = result.exit_code == NOT_JUDGED
    reason = result.warnings[0] if is_unjudged else f"ended by its {result.end_reason} after {result.simulated_s:.2f} s"
    text = f"seed {result.seed}: {reason}"
    error = SimulationError(text)
    for note in (*result.final_state, *reproduction_lines(result)):
        error.add_note(note)
    return error
