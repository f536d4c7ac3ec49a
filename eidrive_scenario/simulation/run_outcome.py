"""Outcome of a run: verdicts, metrics, and the warnings that only the whole run can give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from eidrive_scenario.driving.motionless import MotionlessStations
from eidrive_scenario.evaluation.criterion import Criterion, Verdict, checked_metrics, checked_verdict
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.simulation.run import ABORTED, FAILED, PASSED
from eidrive_scenario.storyboard.state.external_inputs import user_value_warnings
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.unstarted import unstarted

TIME_LIMIT = "time limit"
"""End of a run that simulated time has cut off."""
_CUT_SHORT = ("command: exitFailure",)
"""Ends of a failed run that leave the rest of the storyboard out."""


def final_verdicts(criteria: Sequence[Criterion], exit_verdict: Verdict | None) -> tuple[Verdict, ...]:
    """Return the verdicts of all criteria, and of the command that has ended the run."""
    verdicts = [checked_verdict(criterion) for criterion in criteria]
    return tuple(verdicts if exit_verdict is None else [*verdicts, exit_verdict])


def criteria_metrics(criteria: Sequence[Criterion]) -> dict[str, float]:
    """Return the metrics of all criteria, by name."""
    metrics: dict[str, float] = {}
    for criterion in criteria:
        metrics.update(checked_metrics(criterion))
    return metrics


def exit_code_of(verdicts: Sequence[Verdict], end: str) -> int:
    """Return the exit code of a run with these verdicts and this reason for its end."""
    if not all(verdict.passed for verdict in verdicts):
        return FAILED
    return ABORTED if end == TIME_LIMIT else PASSED


def late_warnings(
    scenario: Scenario,
    storyboard: Storyboard,
    motionless: MotionlessStations,
    user_values: tuple[Mapping[str, str], Mapping[str, str]],
    time: float,
    end: str,
) -> Iterator[str]:
    """Yield the warnings of a run that has ended at `time` [s].

    user_values  all that were set, and those of them that the caller's settings have set
    """
    yield from map(str, storyboard.context.warnings)
    yield from user_value_warnings(storyboard.context.requested_user_values, *user_values)
    yield from map(str, motionless.warnings(scenario, time))
    if end not in _CUT_SHORT and not end.startswith("criterion: "):
        yield from map(str, unstarted(storyboard.root, scenario, time, end))
