"""Text of a failed or aborted test of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.errors import EidriveError, ExtensionError, InputError
from eidrive_scenario.exit_codes import ABORTED, NOT_JUDGED
from eidrive_scenario.files.encodable import encodable, printable

if TYPE_CHECKING:
    from eidrive_scenario.evaluation import Verdict
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.simulation import RunResult

_SHOWN_FAILURES = 5
"""Number of failed runs that a failed test of the success rate explains."""


class ScenarioFailed(Exception):
    """Failed verdict of a run."""

    def __init__(self, result: RunResult | RateVerdict) -> None:
        super().__init__(explain_outcome(result))
        self.result = result


def explain_rate(verdict: RateVerdict) -> str:
    """Return the reason of a failed or undecided test of the success rate, with its first failed runs."""
    shown = [explain(failure) for failure in verdict.failures[:_SHOWN_FAILURES]]
    more = len(verdict.failures) - len(shown)
    return "\n\n".join([str(verdict), *shown, *([f"and {more} more failed runs"] if more else [])])


def explain_outcome(result: RunResult | RateVerdict) -> str:
    """Return the reason of a failed run, or of a failed test of the success rate."""
    from eidrive_scenario.simulation import RunResult

    return printable(explain(result) if isinstance(result, RunResult) else explain_rate(result))


def explain(result: RunResult) -> str:
    """Return the reasons of a failed run, its last state, the command that repeats it, and its recording."""
    from eidrive_scenario.experiments.commands import reproduction_lines

    run = "" if result.run is None else f"run {result.run} of "
    outcome = "is not judged" if result.exit_code == NOT_JUDGED else "failed"
    head = f"{run}{result.scenario} {outcome} with channel {result.channel}, seed {result.seed}"
    return "\n".join([head, *reasons(result), *result.final_state, *reproduction_lines(result)])


def reasons(result: RunResult) -> list[str]:
    """Return a line for each failed criterion, and for a run without a verdict its reason."""
    lines = [_reason(verdict) for verdict in result.criteria if not verdict.passed]
    if not lines or has_no_verdict(result):
        lines.append(_reason_without_verdict(result))
    return lines


def has_no_verdict(result: RunResult | RateVerdict) -> bool:
    """Whether a single run has reached its limit of simulated time before a criterion failed, or has no criterion."""
    return getattr(result, "exit_code", None) in (ABORTED, NOT_JUDGED)


def failures_of(result: RunResult | RateVerdict) -> list[RunResult]:
    """Return the failed runs that a report explains; none for a passed test."""
    from eidrive_scenario.simulation import RunResult

    if result.passed:
        return []
    return [result] if isinstance(result, RunResult) else list(result.failures[:_SHOWN_FAILURES])


def _reason_without_verdict(result: RunResult) -> str:
    if result.exit_code == NOT_JUDGED:
        from eidrive_scenario.simulation.run_outcome import UNJUDGED

        return (
            f"{UNJUDGED}; add one to the scenario or by --eidrive-criterion '{{collision: {{of: Ego}}}}', or set the "
            "ini option eidrive_without_criteria to warn or pass"
        )
    return f"ended by its {result.end_reason} after {result.simulated_s:.2f} s"


def _reason(verdict: Verdict) -> str:
    quantities = (("value", verdict.value, verdict.unit), ("limit", verdict.limit, verdict.unit))
    facts = [f"{name} {value:g} {unit}".rstrip() for name, value, unit in quantities if value is not None]
    if verdict.first_violation is not None:
        facts.append(f"first violated at {verdict.first_violation:.2f} s")
    return f"{verdict.name}: {verdict.reason}" + (f" ({', '.join(facts)})" if facts else "")


def failure_text(error: BaseException) -> str | None:
    """Return the text of a failure without traceback, or None for an error that requires a traceback."""
    if isinstance(error, ScenarioFailed | InputError):
        return printable(str(error))
    notes: list[str] = getattr(error, "__notes__", [])
    if isinstance(error, OSError) and notes:
        return printable("\n".join([f"aborted: {error}", *notes]))
    if not isinstance(error, EidriveError):
        return None
    lines = [str(error), *notes]
    if isinstance(error, ExtensionError):
        from eidrive_scenario.simulation.attribution import traceback_from_extension

        lines += ["", encodable(traceback_from_extension(error))]
    return printable("\n".join(lines).rstrip())
