"""Outcome of a run: verdicts, metrics, exit code, late warnings, and the result with all of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain

import msgspec

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.stack import DrivingStack
from eidrive_scenario.driving.station_warnings import MotionlessStations
from eidrive_scenario.errors import ABORTED, FAILED, NOT_JUDGED, PASSED, Diagnostic, counted
from eidrive_scenario.evaluation.criteria_parser import EXITS
from eidrive_scenario.evaluation.criterion import CriteriaObserver, Criterion, Verdict, checked_metrics, checked_verdict
from eidrive_scenario.evaluation.known_actors import FalseTracks
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.text.run_log import FinalState
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.simulation.commands import RunState
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings
from eidrive_scenario.simulation.result import RunResult
from eidrive_scenario.storyboard.state.commands import user_value_warnings
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.unstarted import unstarted
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

TIME_LIMIT = "time limit"
"""Reason for the end of a run that reaches the limit of simulated time."""
EXIT_COMMAND = "command: "
FATAL_CRITERION = "criterion: "
"""Prefixes of the reasons for an end by an exit command, and by a fatal criterion; its name follows."""
EXPIRED_SHARE = 0.1
"""Share of the received messages of a link that may be too old for their receiver without a warning."""
MOST_SIMULTANEOUS = 10
"""Number of messages of a link that may all be lost because the receiver was transmitting, without a warning."""
UNJUDGED = "the run is not judged: it has no criterion"
"""Start of the warning of a run without verdicts."""
HOW_TO_JUDGE = (
    "add one to the scenario or by RunSettings.criteria '{collision: {of: Ego}}', or accept the run by "
    "RunSettings.no_criteria"
)
"""Hint to the warning."""


class RunMeasures:
    """Measurements of a run in each tick, apart from its criteria.

    stack  driving stack, whose stations are watched for standstill and false tracks
    """

    def __init__(self, stack: DrivingStack) -> None:
        self._stack = stack
        self.trace = TraceHash()
        self.false_tracks = FalseTracks()
        self.final_state = FinalState()
        self.motionless = MotionlessStations(stack.possible_drivers)

    def observe(self, frame: Frame, driven: Collection[str]) -> None:
        """Process one frame; `driven` are the stations that drive their vehicle."""
        if self.motionless.watching:
            self.motionless.observe(frame.view, driven)
        self.trace.observe(frame)
        self.final_state.observe(frame)
        if limits := self._stack.min_existence:
            self.false_tracks.observe(frame, limits)


class RunEnd(msgspec.Struct, frozen=True):
    """End of a run: the last frame, the reason, the wall time until then [s], and `RunResult.final_links`."""

    frame: Frame
    reason: str
    wall_s: float
    final_links: Sequence[LinkEvent] = ()

    @classmethod
    def of(cls, state: RunState, frame: Frame, reason: str, wall_s: float) -> RunEnd:
        """Return the end of a run after its last frame, and pass the outcomes of the last tick to the criteria."""
        links = state.stack.final_links()
        for criterion in state.criteria:
            criterion.observe_final_links(links)
        return cls(frame, reason, wall_s, links)


def build_result(
    state: RunState,
    end: RunEnd,
    *,
    settings: ResolvedSettings,
    measures: RunMeasures,
    observer: CriteriaObserver,
    late_warnings: Iterator[str],
    no_criteria: bool = False,
) -> RunResult:
    """Return the result of a run that has ended; for `no_criteria` see RunSettings."""
    frame, scenario, stack = end.frame, state.scenario, state.stack
    links = dict(stack.link_statistics(frame.view.time))
    for criterion in state.criteria:
        criterion.observe_links(links)
    verdicts = observer.verdicts(state.exit)
    exit_code = exit_code_of(verdicts, end.reason, no_criteria=no_criteria)
    unjudged = [] if verdicts else [UNJUDGED if no_criteria else f"{UNJUDGED}; {HOW_TO_JUDGE}"]
    of_links = chain(expired_messages(links), simultaneous_messages(links))
    metrics = criteria_metrics(state.criteria)
    metrics.update(stack.metrics(frame.view.time))
    metrics.update(measures.false_tracks.metrics())
    metrics.update({f"monitor.{name}": float(value) for name, value in frame.monitors.items()})
    return RunResult(
        scenario=settings.scenario,
        seed=settings.seed,
        channel=stack.channel_name,
        passed=exit_code == PASSED,
        end_reason=end.reason,
        exit_code=exit_code,
        criteria=verdicts,
        metrics=metrics,
        trace_hash=measures.trace.hexdigest(),
        simulated_s=frame.view.time,
        wall_s=end.wall_s,
        warnings=tuple(dict.fromkeys([*unjudged, *state.warnings, *late_warnings, *map(str, of_links)])),
        parameters=dict(scenario.parameters),
        run=settings.run,
        links=links,
        final_links=tuple(end.final_links),
        settings=settings,
        final_state=measures.final_state.lines(),
    )


def criteria_metrics(criteria: Sequence[Criterion]) -> dict[str, float]:
    """Return the metrics of all criteria, by name.

    A metric with the name but not the value of an earlier one begins with the name of its criterion.
    """
    metrics: dict[str, float] = {}
    for criterion in criteria:
        for name, value in checked_metrics(criterion).items():
            if metrics.setdefault(name, value) != value:
                metrics[f"{criterion.name}.{name.partition('.')[2]}"] = value
    return metrics


def exit_code_of(verdicts: Sequence[Verdict], end: str, *, no_criteria: bool = False) -> int:
    """Return the exit code of a run with these verdicts and this reason for its end.

    no_criteria  whether a run without verdicts passes
    """
    if not all(verdict.passed for verdict in verdicts):
        return FAILED
    if end == TIME_LIMIT:
        return ABORTED
    return PASSED if verdicts or no_criteria else NOT_JUDGED


def end_reason(state: RunState, storyboard: Storyboard, time: float, time_limit: float) -> str | None:
    """Return the reason for which a run ends at this time [s]; None if it continues."""
    if state.exit is not None:
        return f"{EXIT_COMMAND}{state.exit.name}"
    for criterion in state.criteria:
        if criterion.fatal and (verdict := checked_verdict(criterion)).fatal and not verdict.passed:
            return f"{FATAL_CRITERION}{criterion.name}"
    return scheduled_end(storyboard, time, time_limit)


def scheduled_end(storyboard: Storyboard, time: float, time_limit: float) -> str | None:
    """Return the reason for which the storyboard or the time limit [s] ends a run at this time [s], or None.

    With an exit command in the last tick the run continues for another tick, in which that command ends it.
    """
    end = storyboard.ended or (TIME_LIMIT if time >= time_limit - TIME_TOLERANCE else None)
    if end is not None and any(command.type in EXITS for command in storyboard.context.commands.custom):
        return None
    return end


def _is_failed_early(reason: str) -> bool:
    """Whether a run ended because it failed, before the rest of the storyboard."""
    return reason == f"{EXIT_COMMAND}exitFailure" or reason.startswith(FATAL_CRITERION)


def expired_messages(links: Mapping[tuple[str, str], LinkStatistics]) -> Iterator[Diagnostic]:
    """Yield a warning for each receiver of a link with more than EXPIRED_SHARE of messages that are too old for it."""
    senders: dict[str, list[str]] = {}
    for (sender, receiver), link in links.items():
        if link.expired > EXPIRED_SHARE * link.received:
            senders.setdefault(receiver, []).append(sender)
    for receiver, (sender, *others) in sorted(senders.items()):
        link = links[sender, receiver]
        more = f", and messages of {counted(len(others), 'more station')}" if others else ""
        yield Diagnostic(
            f"station {receiver!r} does not use {link.expired} of {counted(link.received, 'received message')} of "
            f"{sender!r}{more}: they are too old on arrival (mean delay {link.mean_delay or 0.0:.3g} s)",
            "limits are its property report_timeout, and max_age or max_lateness of its fusion method",
        )


def simultaneous_messages(links: Mapping[tuple[str, str], LinkStatistics]) -> Iterator[Diagnostic]:
    """Yield a warning for each receiver of a link that loses all messages because both stations transmit at once."""
    senders: dict[str, list[str]] = {}
    for (sender, receiver), link in links.items():
        if link.sent > MOST_SIMULTANEOUS and link.lost_by.get("half_duplex") == link.sent - link.in_flight:
            senders.setdefault(receiver, []).append(sender)
    for receiver, (sender, *others) in sorted(senders.items()):
        lost = links[sender, receiver].lost
        more = f", and those of {counted(len(others), 'more station')}" if others else ""
        yield Diagnostic(
            f"station {receiver!r} receives none of {counted(lost, 'message')} of {sender!r}{more}: it always "
            "transmits at the same time (half_duplex)",
            "set a jitter of the channel above 0, or different properties message_phase",
        )


def late_warnings(
    scenario: Scenario,
    storyboard: Storyboard,
    motionless: MotionlessStations,
    user_values: tuple[Mapping[str, str], Mapping[str, str]],
    end: RunEnd,
) -> Iterator[str]:
    """Yield the warnings of a run that has ended.

    user_values  all values that were set, and those of them that the settings of the run set
    """
    time = end.frame.view.time
    yield from map(str, storyboard.context.warnings)
    if storyboard.context.traffic is not None:
        yield from map(str, storyboard.context.traffic.shortages())
    yield from user_value_warnings(storyboard.context.requested_user_values, *user_values)
    yield from map(str, motionless.warnings(scenario, time))
    if not _is_failed_early(end.reason):
        yield from map(str, unstarted(storyboard.root, scenario, time, end.reason))
