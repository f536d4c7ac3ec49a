"""Evaluation of a recorded run: with the criteria of the run, or with other ones."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import ABORTED, INVALID_INPUT, PASSED, Diagnostic, EidriveError, InputError, SettingError
from eidrive_scenario.evaluation.criteria_parser import (
    CRITERION,
    EXITS,
    CriteriaContext,
    CriterionDeclaration,
    build_criteria,
    exit_verdict,
    parse_criteria,
)
from eidrive_scenario.evaluation.criterion import CriteriaObserver, Criterion, Verdict, bind_roads
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.recording.recording import Recording, open_recording
from eidrive_scenario.recording.run_files import ROAD_FILE, recording_in
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.run_options import RunSettings, with_option_names
from eidrive_scenario.simulation.attribution import report_extension
from eidrive_scenario.simulation.commands import parse_added_criteria
from eidrive_scenario.simulation.recorded_outcome import (
    CONTEXT,
    plain_verdict,
    recorded_context,
    recorded_outcome,
    recorded_scope,
)
from eidrive_scenario.simulation.result import verdict_json
from eidrive_scenario.simulation.run_outcome import UNJUDGED, criteria_metrics, exit_code_of
from eidrive_scenario.storyboard.state.commands import CustomCommand

INCOMPLETE = "the recording is incomplete"
"""Reason for the end of a recording without the outcome of its run."""


@dataclass(frozen=True)
class Judgement:
    """Verdicts on a recorded run.

    exit_code  as that of a run; 3 also for an incomplete or damaged recording
    metrics    of the criteria, by name
    warnings   damage of the recording, and differences from the verdicts of the run
    """

    recording: Path
    scenario: str
    seed: int
    end_reason: str
    exit_code: int
    criteria: tuple[Verdict, ...]
    metrics: Mapping[str, float]
    simulated_s: float
    warnings: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True if all criteria passed, and the run ended before its time limit; False without criteria."""
        return self.exit_code == PASSED

    def as_json(self) -> dict[str, Any]:
        """Return the object that `eidrive judge --json` prints, with the keys of that of a run."""
        return {
            "scenario": self.scenario,
            "seed": self.seed,
            "passed": self.passed,
            "end_reason": self.end_reason,
            "criteria": list(map(verdict_json, self.criteria)),
            "warnings": list(map(with_option_names, self.warnings)),
            "metrics": dict(self.metrics),
            "simulated_s": self.simulated_s,
            "recording": str(self.recording),
        }


@dataclass(frozen=True)
class FailedJudgement:
    """Recording that `judge_recording` cannot judge, and its error."""

    recording: Path
    error: EidriveError

    @property
    def exit_code(self) -> int:
        """Exit code of the error: 2 for invalid input, 3 for a fault of a criterion."""
        return INVALID_INPUT if isinstance(self.error, InputError) else ABORTED

    def as_json(self) -> dict[str, Any]:
        """Return the object that `eidrive judge --json` prints, with the keys of that of an aborted run."""
        error = self.error.as_json()
        return {"passed": False, "end_reason": "error", "error": error, "recording": str(self.recording)}


def judge_recording(location: str | os.PathLike[str], criteria: Any = None) -> Judgement:
    """Judge a recorded run, given as its recording or the folder of the run.

    criteria  None for the criteria of the run, whose verdicts then equal those of the run bit for bit; or other
              criteria, as in `RunSettings(criteria=…)`, which replace those of the run

    The readable frames of an incomplete or damaged recording are judged. Raise InputError if it cannot be read, has
    no readable frame, or lacks what a criterion requires, and ExtensionError for a fault of a criterion.
    """
    try:
        return _judge(open_recording(recording_in(path_argument(location, "location"))), criteria)
    except EidriveError:
        raise
    except (Exception, SystemExit) as error:
        report_extension(error)
        raise


def _judge(recording: Recording, others: Any) -> Judgement:
    """Judge a recording by its own criteria, which join and leave it as in the run, or by `others`."""
    outcome, text, source = recorded_outcome(recording), recording.attachments.get(ROAD_FILE), str(recording.path)
    roads = None if text is None else RoadNetwork.parse(text, f"{recording.path}/{ROAD_FILE}")
    criteria: list[Criterion] = []

    def add(declarations: Iterable[CriterionDeclaration]) -> None:
        for criterion in build_criteria(declarations, [criterion.name for criterion in criteria]):
            if outcome is None and type(criterion).observe_links is not Criterion.observe_links:
                message = f"criterion {criterion.name!r} requires link statistics, and the recording has none"
                raise SettingError(Diagnostic(message, "the run did not end, or an older version recorded it", source))
            bind_roads(criterion, roads)
            criteria.append(criterion)

    if others is not None:
        sources, context = RunSettings(criteria=others).criteria_sources, recorded_context(recording)
        add(parse_added_criteria(sources, context, recorded_scope(recording)))
    elif CONTEXT not in recording.metadata:
        version = recording.metadata.get("eidrive-scenario", "unknown")
        message = f"the recording contains no criteria (written by version {version})"
        raise SettingError(Diagnostic(message, "give criteria (RunSettings.criteria)", source))
    observer, context = CriteriaObserver(criteria), CriteriaContext(has_roads=roads is not None)
    exit_command: Verdict | None = None
    end: float | None = None
    skipped: list[str] = []
    for frame in recording.frames(skipped.append):
        for command in frame.commands if others is None else ():
            if command.type == CRITERION:
                add(_criteria_of_run(command.content, context, recording))
            elif command.type in EXITS:
                exit_command = exit_verdict(CustomCommand(command.type, command.content, 0, source), command.time)
        observer.observe(frame)
        end = frame.view.time
    damage = [*recording.damage, *skipped]
    if end is None:
        hint = "; ".join(damage) or "record the run again"
        raise SettingError(Diagnostic("the recording contains no readable frame", hint, source))
    links = {} if outcome is None else {(link.sender, link.receiver): link.statistics for link in outcome.links}
    for criterion in criteria:
        criterion.observe_final_links(() if outcome is None else outcome.final_links)
        criterion.observe_links(links)
    verdicts = tuple(map(plain_verdict, observer.verdicts(exit_command)))
    hint = "give one by RunSettings.criteria, such as '{collision: {of: Ego}}'"
    warnings = [] if verdicts else [f"{UNJUDGED}; {hint}"]
    warnings += [f"the recording is damaged: {line}" for line in damage]
    if others is None and outcome is not None and not damage:
        warnings += _differences(verdicts, outcome.criteria)
    end_reason = INCOMPLETE if outcome is None else outcome.end_reason
    return Judgement(
        recording.path,
        recording.scenario,
        recording.seed,
        end_reason,
        ABORTED if damage or outcome is None else exit_code_of(verdicts, end_reason),
        verdicts,
        criteria_metrics(criteria),
        end,
        tuple(warnings),
    )


def _criteria_of_run(text: str, context: CriteriaContext, recording: Recording) -> tuple[CriterionDeclaration, ...]:
    """Return the criteria of a command of the run. Raise SettingError for those that only its extensions know."""
    try:
        return parse_criteria(text, context)
    except SettingError as error:
        run = recording.metadata.get("command") or "the run"
        hint = f"judge it with the extensions of {run}, or with other criteria (RunSettings.criteria)"
        source = str(recording.path)
        raise SettingError([Diagnostic(entry.message, hint, source) for entry in error.diagnostics]) from error


def _differences(judged: Sequence[Verdict], recorded: Sequence[Verdict]) -> list[str]:
    """Return a warning for each verdict that differs from that of the run, for example by another version."""
    earlier = {verdict.name: verdict for verdict in recorded}
    return [
        f"verdict {verdict.name!r} differs from that of the run: {_text(verdict)}, in the run {_text(held)}"
        for verdict in judged
        if (held := earlier.get(verdict.name)) != verdict
    ]


def _text(verdict: Verdict | None) -> str:
    if verdict is None:
        return "absent"
    return f"{'passed' if verdict.passed else 'failed'} ({verdict.reason})"
