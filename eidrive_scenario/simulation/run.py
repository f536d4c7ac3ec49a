"""Settings, result and observers of a run."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from numbers import Number, Real
from operator import index
from pathlib import Path
from typing import Any, Protocol, SupportsIndex

import numpy as np

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.resolved_settings import ResolvedSettings
from eidrive_scenario.simulation.added_settings import criteria_sources, drive_sources
from eidrive_scenario.simulation.result_views import outcome_word, result_html, result_row
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

DEFAULT_SEED = 1
"""Seed of a run for which none is given, in Python, in pytest and on the command line."""


@dataclass(frozen=True)
class RunSettings:
    """Optional settings of a run; None uses the value of the scenario file.

    channel         profile: a name, a file, YAML text or a mapping; 'none' disables cooperation
    detector        for all stations
    planner         for all driven stations; parked ones, with the planner `none`, remain parked
    cooperate       senders whose messages the receiving stations use; () disables reception
    parameters      values of scenario parameters; an Assignment contains the file and line of the value
    dt              time step [s]
    controllers     controller models of controllers of other tools, by the name of the controller; without an entry the
                    entity keeps lane and speed
    time_limit      maximum simulated time [s], above 0, for scenarios without an end
    weather         preset or file; it overrides weather and road condition of the scenario
    user_values     of UserDefinedValueConditions, by name; `Simulation.set_user_value` changes them during the run
    drive           entities that get a driving stack, which replaces their controllers: names, or a mapping of names to
                    the properties of the stack (mapping, YAML text, file; None: defaults); see docs/scenario_files.md
    criteria        further criteria: a mapping, a YAML text, a file, or a list of these
    allow_torchscript  whether detectors may load TorchScript weights, which can execute any code; see docs/security.md
    no_criteria     whether a run that no criterion judges passes; without it, its exit code is NOT_JUDGED
    """

    channel: str | Path | Mapping[str, Any] | None = None
    detector: str | None = None
    planner: str | None = None
    cooperate: tuple[str, ...] | None = None
    parameters: Mapping[str, str | Assignment] = field(default_factory=dict)
    dt: float = 0.05
    time_limit: float = 120.0
    controllers: Mapping[str, str] = field(default_factory=dict)
    weather: str | Path | None = None
    user_values: Mapping[str, str] = field(default_factory=dict)
    drive: Mapping[str, Any] | Iterable[str] | None = None
    criteria: str | Path | Mapping[str, Any] | Iterable[str | Path | Mapping[str, Any]] | None = None
    allow_torchscript: bool = False
    no_criteria: bool = False

    def __post_init__(self) -> None:
        """Convert values of parameters and user-defined values to texts, as on a command line.

        Raise SettingError for values of a wrong type, and for a time limit that is not positive.
        """
        for name, types, expected in _TYPES:
            value = getattr(self, name)
            # bool is a subclass of int, but True is not a number of seconds
            if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
                raise SettingError(Diagnostic(f"{name} is {quoted(value)}", f"give {expected}"))
        object.__setattr__(self, "cooperate", _senders(self.cooperate))
        object.__setattr__(self, "drive", drive_sources(self.drive))
        object.__setattr__(self, "criteria", criteria_sources(self.criteria))
        for name in ("parameters", "user_values", "controllers"):
            object.__setattr__(self, name, _texts(name, getattr(self, name)))
        if not self.time_limit > 0.0:
            raise SettingError(Diagnostic(f"time_limit is {self.time_limit}", "give a positive number of seconds"))


_PLACE: tuple[type, ...] = (str, os.PathLike, type(None))
_TYPES: tuple[tuple[str, tuple[type, ...], str], ...] = (
    ("channel", (*_PLACE, Mapping), "the name, the file or the mapping of a channel profile"),
    ("weather", _PLACE, "the name or the file of a weather preset"),
    ("detector", (str, type(None)), "the name of a detector"),
    ("planner", (str, type(None)), "the name of a planner"),
    ("parameters", (Mapping,), "a mapping of names to values"),
    ("user_values", (Mapping,), "a mapping of names to values"),
    ("controllers", (Mapping,), "a mapping of controllers to controller models"),
    ("dt", (Real,), "a number of seconds"),
    ("time_limit", (Real,), "a number of seconds"),
    # A text such as "no" would be true
    ("allow_torchscript", (bool,), "True or False"),
    ("no_criteria", (bool,), "True or False"),
)
"""Types of the settings of a run, and the expected values in messages."""


def _senders(given: Any) -> tuple[str, ...] | None:
    """Return names of stations as a tuple; those of a set are sorted."""
    if given is None:
        return None
    if isinstance(given, str):
        raise SettingError(Diagnostic(f"cooperate is the text {given!r}", "give a tuple of station names"))
    names = sorted(given, key=str) if isinstance(given, Set) else given
    found = tuple(names) if isinstance(names, Iterable) else (names,)
    if not all(isinstance(name, str) for name in found):
        raise SettingError(Diagnostic(f"cooperate is {quoted(given)}", "give a tuple of station names"))
    return found


def _texts(setting: str, values: Mapping[Any, Any]) -> dict[str, str | Assignment]:
    """Return names with values as texts; Assignments are unchanged."""
    texts: dict[str, str | Assignment] = {}
    for name, value in values.items():
        if not isinstance(name, str):
            raise SettingError(Diagnostic(f"{setting} has the name {quoted(name)}", "give a text"))
        texts[name] = value if isinstance(value, Assignment) else as_setting_text(f"{setting}[{name!r}]", value)
    return texts


def as_setting_text(what: str, value: object) -> str:
    """Return the value of a parameter or a user-defined value as the text in a file or on a command line.

    Raise SettingError unless it is a text, number, truth value or path.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, Number | Path):
        return str(value)
    raise SettingError(Diagnostic(f"{what} is {quoted(value)}", "give a text, a number or a truth value"))


def checked_seed(seed: SupportsIndex) -> int:
    """Return a seed, such as an entry of an array, as an int. Raise SettingError if it is not an integer."""
    try:
        return index(seed)
    except TypeError:
        raise SettingError(Diagnostic(f"the seed is {seed!r}", "give an integer")) from None


@dataclass(frozen=True)
class RunResult:
    """Result of a run."""

    scenario: str
    seed: int
    channel: str
    passed: bool
    """Whether all criteria passed before the time limit; False for a run that no criterion judges."""
    end_reason: str
    """Reason for the end: stop trigger, storyboard complete, criterion: NAME, command: NAME, or time limit."""
    exit_code: int
    criteria: tuple[Verdict, ...]
    metrics: Mapping[str, float]
    trace_hash: str
    simulated_s: float
    wall_s: float
    warnings: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    """Parameters of the scenario, with the values of the run."""
    run: int | None = None
    """Index among the runs of a parameter value distribution, from 0."""
    links: Mapping[tuple[str, str], LinkStatistics] = field(default_factory=dict)
    """Link statistics, by (sender, receiver)."""
    final_links: tuple[LinkEvent, ...] = ()
    """Message outcomes that became known in the last tick; those before are in `Frame.links`."""
    settings: ResolvedSettings = field(default_factory=ResolvedSettings)
    """All settings that determine the run."""
    final_state: tuple[str, ...] = ()
    """State of the storyboard and last decision of each driven station at the end of the run, as lines of text."""
    command: str = ""
    """Command line that reproduces the run; empty for a scenario without a file."""
    folder: Path | None = None
    """Folder of `result.json`; None if it was not written."""
    recording: Path | None = None
    """Recording; None if it was not written."""

    def __str__(self) -> str:
        """Return the outcome in one line."""
        failed = [verdict.name for verdict in self.criteria if not verdict.passed]
        outcome = f"failed by {', '.join(failed)}" if failed else outcome_word(self)
        number = "" if self.run is None else f", run {self.run}"
        warned = f", {len(self.warnings)} warning{'s' * (len(self.warnings) > 1)}" if self.warnings else ""
        head = f"{self.scenario}{number}, seed {self.seed}, channel {self.channel}"
        return f"{head}: {outcome} ({self.end_reason} at {self.simulated_s:.2f} s{warned})"

    def _repr_html_(self) -> str:
        """Return the outcome as HTML for notebooks; all texts are escaped."""
        return result_html(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as one flat row: every value is a number, a text, a truth value or None.

        Columns: the outcome; `parameter.NAME`, as a number if the value is one; `channel.KEY`, the content of the
        channel at the start; `NAME.passed`, `.value`, `.limit` of each criterion; the metrics by their names;
        `warnings`, the number of them. `pandas.DataFrame([result.to_dict() for result in results])` is a table of runs.
        """
        return result_row(self)

    def as_json(self) -> dict[str, Any]:
        """Return the object that `--json` prints."""
        return {
            "scenario": self.scenario,
            **({} if self.run is None else {"run": self.run}),
            "parameters": dict(self.parameters),
            "seed": self.seed,
            "channel": self.channel,
            "passed": self.passed,
            "end_reason": self.end_reason,
            "criteria": [
                {
                    "name": verdict.name,
                    "passed": verdict.passed,
                    "value": verdict.value,
                    "limit": verdict.limit,
                    "unit": verdict.unit,
                    "reason": verdict.reason,
                }
                for verdict in self.criteria
            ],
            "final_state": list(self.final_state),
            "warnings": list(self.warnings),
            "metrics": dict(self.metrics),
            "links": [
                {"sender": sender, "receiver": receiver, **statistics.as_json()}
                for (sender, receiver), statistics in self.links.items()
            ],
            "trace_hash": self.trace_hash,
            "simulated_s": self.simulated_s,
            "wall_s": self.wall_s,
            "settings": self.settings.as_json(),
            "settings_sha256": self.settings.digest,
            "command": self.command,
        }


class Observer(Protocol):
    """Observer of a run that does not change it, such as a recorder, a CSV writer or a collector of images.

    It may have the methods `begin(simulation)`, called before its first frame, and `conclude(result)`, which
    `Simulation.run` calls with the result of a completed run.
    """

    def observe(self, frame: Frame) -> None:
        """Process one frame."""

    def close(self) -> None:
        """Finish after the last frame."""


def checked_observer(observer: Observer) -> Observer:
    """Return an observer. Raise SettingError for an object that lacks the methods of an observer."""
    for method in ("observe", "close"):
        if not callable(getattr(observer, method, None)):
            name = type(observer).__name__
            raise SettingError(
                Diagnostic(f"observer {name} has no method {method}", "define observe(frame) and close()")
            )
    return observer
