"""What is asked of a run, what it comes to, and who may watch it."""

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
from eidrive_scenario.simulation.result_views import result_html, result_row
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

PASSED, FAILED, INVALID_INPUT, ABORTED = range(4)
"""Exit codes of a run."""

DEFAULT_SEED = 1
"""Seed of a run for which none is given, in Python, in pytest and on the command line."""


@dataclass(frozen=True)
class RunSettings:
    """What a caller may say beside the file; None leaves it to the file.

    channel         profile name or file; 'none' is no cooperation
    detector        for all stations
    cooperate       the senders whom listening stations hear; () is nobody
    parameters      values for parameters of the scenario; an Assignment knows the file and line that gave the value
    dt              step [s]
    controllers     who stands in for controllers of other tools, by the controller's name; without an entry its entity
                    keeps lane and speed
    time_limit      [s] of simulated time, above 0, for files that do not end by themselves
    weather         preset or file; it wins over all that the file says of weather and road
    user_values     for UserDefinedValueConditions, by name; `Simulation.set_user_value` changes them during the run
    allow_torchscript   whether detectors may load TorchScript weights, which can execute any code; see docs/security.md
    """

    channel: str | Path | None = None
    detector: str | None = None
    cooperate: tuple[str, ...] | None = None
    parameters: Mapping[str, str | Assignment] = field(default_factory=dict)
    dt: float = 0.05
    time_limit: float = 120.0
    controllers: Mapping[str, str] = field(default_factory=dict)
    weather: str | Path | None = None
    user_values: Mapping[str, str] = field(default_factory=dict)
    allow_torchscript: bool = False

    def __post_init__(self) -> None:
        """Bring values of parameters and user-defined values to texts, as a command line has them.

        Raises SettingError for values of a wrong type, and for a time limit that ends no run.
        """
        for name, types, expected in _TYPES:
            value = getattr(self, name)
            # A bool is a number to Python, but True is no number of seconds.
            if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
                raise SettingError(Diagnostic(f"{name} is {quoted(value)}", f"give {expected}"))
        object.__setattr__(self, "cooperate", _senders(self.cooperate))
        for name in ("parameters", "user_values", "controllers"):
            object.__setattr__(self, name, _texts(name, getattr(self, name)))
        if not self.time_limit > 0.0:
            raise SettingError(Diagnostic(f"time_limit is {self.time_limit}", "give a positive number of seconds"))


_PLACE: tuple[type, ...] = (str, os.PathLike, type(None))
_TYPES: tuple[tuple[str, tuple[type, ...], str], ...] = (
    ("channel", (*_PLACE, Mapping), "the name, the file or the mapping of a channel profile"),
    ("weather", _PLACE, "the name or the file of a weather preset"),
    ("detector", (str, type(None)), "the name of a detector"),
    ("parameters", (Mapping,), "a mapping of names to values"),
    ("user_values", (Mapping,), "a mapping of names to values"),
    ("controllers", (Mapping,), "a mapping of controllers to who stands in for them"),
    ("dt", (Real,), "a number of seconds"),
    ("time_limit", (Real,), "a number of seconds"),
    # A text such as "no" would be true.
    ("allow_torchscript", (bool,), "True or False"),
)
"""Types of the settings of a run, and what a message states of them."""


def _senders(given: Any) -> tuple[str, ...] | None:
    """Names of stations as a tuple, those of a set in order."""
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
    """Names with values as texts; an Assignment stays what it is."""
    texts: dict[str, str | Assignment] = {}
    for name, value in values.items():
        if not isinstance(name, str):
            raise SettingError(Diagnostic(f"{setting} has the name {quoted(name)}", "give a text"))
        texts[name] = value if isinstance(value, Assignment) else as_setting_text(f"{setting}[{name!r}]", value)
    return texts


def as_setting_text(what: str, value: object) -> str:
    """Return the value of a parameter, or a user-defined value, as a file or a command line writes it.

    Raises SettingError for what is neither a text nor a number, truth value or path.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, Number | Path):
        return str(value)
    raise SettingError(Diagnostic(f"{what} is {quoted(value)}", "give a text, a number or a truth value"))


def checked_seed(seed: SupportsIndex) -> int:
    """Return a seed as an int, such as an entry of an array. Raise SettingError if it is no integer."""
    try:
        return index(seed)
    except TypeError:
        raise SettingError(Diagnostic(f"the seed is {seed!r}", "give an integer")) from None


@dataclass(frozen=True)
class RunResult:
    """What a run came to."""

    scenario: str
    seed: int
    channel: str
    passed: bool
    end_reason: str
    """stop trigger, storyboard complete, criterion: NAME, or time limit"""
    exit_code: int
    criteria: tuple[Verdict, ...]
    metrics: Mapping[str, float]
    trace_hash: str
    simulated_s: float
    wall_s: float
    warnings: tuple[str, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    """Of the scenario as a whole, with the values that counted."""
    run: int | None = None
    """Its number among the runs of a parameter value distribution, from 0 on."""
    links: Mapping[tuple[str, str], LinkStatistics] = field(default_factory=dict)
    """The books of the radio, by (sender, receiver)."""
    settings: ResolvedSettings = field(default_factory=ResolvedSettings)
    """All settings that determined the run."""
    command: str = ""
    """Command line that repeats the run; empty for a scenario without a file."""
    folder: Path | None = None
    """Folder of `result.json`, where the run has left one."""
    recording: Path | None = None
    """The recording, where the run has left one."""

    def __str__(self) -> str:
        """The outcome in one line."""
        failed = [verdict.name for verdict in self.criteria if not verdict.passed]
        outcome = "passed" if self.passed else f"failed by {', '.join(failed)}" if failed else "not passed"
        number = "" if self.run is None else f", run {self.run}"
        warned = f", {len(self.warnings)} warning{'s' * (len(self.warnings) > 1)}" if self.warnings else ""
        head = f"{self.scenario}{number}, seed {self.seed}, channel {self.channel}"
        return f"{head}: {outcome} ({self.end_reason} at {self.simulated_s:.2f} s{warned})"

    def _repr_html_(self) -> str:
        """The outcome as HTML, for notebooks; all texts are escaped."""
        return result_html(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as one flat row: every value is a number, a text, a truth value or None.

        Columns: the outcome; `parameter.NAME`, as a number where the value is one; `channel.KEY`, the content of the
        channel at the start; `NAME.passed`, `.value`, `.limit` of each criterion; the metrics by their names;
        `warnings`, the number of them. `pandas.DataFrame([result.to_dict() for result in results])` is a table of runs.
        """
        return result_row(self)

    def as_json(self) -> dict[str, Any]:
        """The object that `--json` prints."""
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
            "warnings": list(self.warnings),
            "metrics": dict(self.metrics),
            "links": [
                {"sender": sender, "receiver": receiver, **book.as_json()}
                for (sender, receiver), book in self.links.items()
            ],
            "trace_hash": self.trace_hash,
            "simulated_s": self.simulated_s,
            "wall_s": self.wall_s,
            "settings": self.settings.as_json(),
            "settings_sha256": self.settings.digest,
            "command": self.command,
        }


class Observer(Protocol):
    """Watches a run without changing it: a recorder, a CSV writer, a collector of pictures."""

    def observe(self, frame: Frame) -> None:
        """Take one frame."""

    def close(self) -> None:
        """The run is over."""


def checked_observer(observer: Observer) -> Observer:
    """Raise SettingError for an object that lacks the methods of an observer."""
    for method in ("observe", "close"):
        if not callable(getattr(observer, method, None)):
            name = type(observer).__name__
            raise SettingError(
                Diagnostic(f"observer {name} has no method {method}", "define observe(frame) and close()")
            )
    return observer
