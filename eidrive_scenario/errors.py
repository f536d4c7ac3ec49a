"""Exceptions of this package, the diagnostics of invalid input, and the exit codes of runs.

EidriveError
├── InputError           invalid user input: one or several diagnostics, each with file, line and hint
│   ├── ScenarioError    an OpenSCENARIO file
│   │   └── ConstraintError  a parameter's value violates its ConstraintGroups
│   ├── RoadError        an OpenDRIVE file
│   └── SettingError     an option, a controller property, a channel profile
├── RegistryError        two extensions have the same name, or one does not load
└── SimulationError      the run was aborted by an internal error
    ├── ExtensionError   an extension raised an exception or returned an invalid result
    └── WallLimitError   a run or a check exceeded its limit of wall time

InvalidResult is internal: a run reports it as ExtensionError of the extension that returned the result.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ParamSpec, Protocol, Self, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

MAX_DIAGNOSTICS = 200
"""Maximum number of diagnostics of one kind that are collected for one file."""
MAX_TEXT = 1000
"""Maximum number of characters of a message."""
_MAX_WORD = 100
"""Maximum number of characters of a word for which similar words are searched."""
_MAX_CANDIDATES = 2000
"""Maximum number of words with which a misspelled word is compared."""


class Located(Protocol):
    """Element with its file and line; "" and None if unknown."""

    @property
    def source(self) -> str: ...

    @property
    def line(self) -> int | None: ...


@dataclass(frozen=True)
class Diagnostic:
    """One error, warning or note about an input: the message, a hint for its correction, and the location."""

    message: str
    hint: str = ""
    source: str = ""
    line: int | None = None
    rule: str = ""
    """Name of the rule of `eidrive check` that is violated (see docs/checks.md); "" for errors outside of rules."""

    @classmethod
    def at(cls, location: Located, message: str, hint: str = "") -> Self:
        """Return a diagnostic with the location of an element."""
        return cls(message, hint, location.source, location.line)

    def __post_init__(self) -> None:
        if self.line == 0:  # an element that no file contains
            object.__setattr__(self, "line", None)
        if len(self.message) > MAX_TEXT or len(self.hint) > MAX_TEXT:
            object.__setattr__(self, "message", shortened(self.message))
            object.__setattr__(self, "hint", shortened(self.hint))

    def __str__(self) -> str:
        source = in_one_line(self.source)
        location = f"{source}:{self.line}" if self.line is not None else source
        head = f"{location}: {self.message}" if location else self.message
        return f"{head}; {self.hint}" if self.hint else head


class EidriveError(Exception):
    """Base class of all exceptions of this package."""

    def as_json(self) -> dict[str, Any]:
        """Return the JSON object that `--json` prints for a run that was aborted by this error."""
        return {"kind": "run", "message": str(self)}


class InputError(EidriveError):
    """Invalid user input. `diagnostics` holds all diagnostics in the order of the file."""

    def __init__(self, diagnostics: Diagnostic | Sequence[Diagnostic]) -> None:
        self.diagnostics: tuple[Diagnostic, ...] = (
            (diagnostics,) if isinstance(diagnostics, Diagnostic) else tuple(diagnostics)
        )
        super().__init__("\n".join(str(diagnostic) for diagnostic in self.diagnostics))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Diagnostic, ...]]]:
        return type(self), (self.diagnostics,)

    def at(self, source: str, line: int | None = None) -> Self:
        """Return the error with this location at each diagnostic that has none."""
        located = [
            diagnostic if diagnostic.source else replace(diagnostic, source=source, line=line)
            for diagnostic in self.diagnostics
        ]
        return type(self)(located)


class ScenarioError(InputError):
    """Invalid OpenSCENARIO file."""


class ConstraintError(ScenarioError):
    """Violation of parameter constraints, without any other error.

    By the standard such a scenario is not evaluated: a run of a distribution is skipped, not failed.
    """


class RoadError(InputError):
    """Invalid OpenDRIVE file."""


class SettingError(InputError):
    """Invalid option, controller property or profile."""


class OutputError(SettingError):
    """Output path that cannot be written, or that another run writes."""


class RegistryError(EidriveError):
    """Duplicate name of extensions, or an extension that does not load."""


class SimulationError(EidriveError):
    """Run that was aborted by an internal error."""


@dataclass(frozen=True)
class ExtensionPlace:
    """Call of an extension: the extension, the station, actor or element, the time, and the line of its code.

    kind      singular of the entry-point group (detector, planner, …), or observer
    name      name of the entry point; class of an observer
    value     module and object of the entry point
    subject   station 'Ego', actor 'Ego', or the location of an element in the file
    time      simulated time [s]; None before the run
    """

    kind: str
    name: str
    value: str
    subject: str = ""
    time: float | None = None
    file: str = ""
    line: int | None = None
    function: str = ""

    def __str__(self) -> str:
        location = f"{self.file}:{self.line}: " if self.file else ""
        value = f" ({self.value})" if self.value else ""
        subject = f" of {self.subject}" if self.subject else ""
        time = f" at t = {self.time:.3f} s" if self.time is not None else ""
        return f"{location}{self.kind} {self.name!r}{value}{subject}{time}"

    def as_json(self) -> dict[str, Any]:
        """Return the fields by name, without unknown ones."""
        return {key: value for key, value in asdict(self).items() if value not in ("", None)}


class ExtensionError(SimulationError):
    """Exception or invalid result of the extension that `place` identifies."""

    def __init__(self, place: ExtensionPlace, description: str) -> None:
        super().__init__(f"{place}: {description}")
        self.place = place
        self.description = description

    def __reduce__(self) -> tuple[type[ExtensionError], tuple[ExtensionPlace, str]]:
        return type(self), (self.place, self.description)

    def as_json(self) -> dict[str, Any]:
        return {**super().as_json(), **self.place.as_json(), "problem": self.description}


class WallLimitError(SimulationError):
    """Run or check that exceeded its limit of wall time.

    limit   wall time [s]
    place   extension that was running; None if none was
    time    simulated time of the run [s]; None before the run
    where   `file:line in function` that was running
    """

    def __init__(
        self, limit: float, place: ExtensionPlace | None = None, time: float | None = None, where: str = ""
    ) -> None:
        if place is not None:
            running = f"{place}: still running" + (f" in {place.function}" if place.function else "")
        else:
            running = f"{where}: " if where else ""
            running += "not finished" + (f" at t = {time:.3f} s" if time is not None else "")
        super().__init__(f"{running} after {limit:g} s of wall time (the wall limit)")
        self.limit, self.place, self.time, self.where = limit, place, time, where

    def __reduce__(self) -> tuple[type[WallLimitError], tuple[float, ExtensionPlace | None, float | None, str]]:
        return type(self), (self.limit, self.place, self.time, self.where)

    def as_json(self) -> dict[str, Any]:
        running = {"kind": "run", "time": self.time} if self.place is None else self.place.as_json()
        return {**super().as_json(), **running, "wall_limit": self.limit}


class InvalidResult(Exception):
    """Invalid result of an extension.

    extension  object whose `method` returned the result
    """

    def __init__(self, extension: object, method: str, description: str) -> None:
        super().__init__(f"{method} {description}")
        self.extension = extension
        self.method = method


class ErrorSubject:
    """Station, actor or element for which extensions are called; errors of an extension within `call` name it.

    Extensions, and classes whose methods call them, have a property of the same name, such as `Agent.error_subject`.
    """

    def __init__(self, subject: str) -> None:
        self._subject = subject

    @property
    def error_subject(self) -> str:
        """Station, actor or element."""
        return self._subject

    def call(
        self, function: Callable[Parameters, Result], *arguments: Parameters.args, **named: Parameters.kwargs
    ) -> Result:
        """Return the result of a function with these arguments."""
        return function(*arguments, **named)


class ErrorCollector:
    """Collect diagnostics of several independent checks.

    An InputError raised inside `with collector:` ends that block and is stored. `raise_if_any` raises one error of
    `kind` with all stored diagnostics, without duplicates.
    """

    def __init__(self, kind: type[InputError] = InputError) -> None:
        self._kind = kind
        self._diagnostics: list[Diagnostic] = []

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, InputError):
            return False
        self._diagnostics += error.diagnostics
        return True

    def raise_if_any(self) -> None:
        """Raise one error with the stored diagnostics, each once, if there are any."""
        if self._diagnostics:
            raise self._kind(list(dict.fromkeys(self._diagnostics)))


def sort_diagnostics(diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return each diagnostic once: files in the order of their first diagnostic, lines of a file ascending."""
    unique = list(dict.fromkeys(diagnostics))
    files = {source: number for number, source in enumerate(dict.fromkeys(diagnostic.source for diagnostic in unique))}
    return sorted(unique, key=lambda diagnostic: (files[diagnostic.source], diagnostic.line or 0))


def limit_diagnostics(diagnostics: Sequence[Diagnostic], count: int = 0) -> list[Diagnostic]:
    """Return the first MAX_DIAGNOSTICS diagnostics, and one with the number of the others.

    count  number of further diagnostics that were not collected
    """
    if count == 0 and len(diagnostics) <= MAX_DIAGNOSTICS + 1:
        return list(diagnostics)  # one more diagnostic takes no more room than its count
    listed = list(diagnostics[:MAX_DIAGNOSTICS])
    unlisted = len(diagnostics) - len(listed) + count
    return [*listed, Diagnostic.at(listed[-1], f"{unlisted} more are not listed")]


def in_one_line(name: object) -> str:
    """Return the name of a file with escapes of newlines, so that no part of it looks like another message."""
    return str(name).replace("\n", "\\u000a")


def shortened(text: str, length: int = MAX_TEXT) -> str:
    """Return a text of at most `length` characters; the middle of a longer one is omitted."""
    if len(text) <= length:
        return text
    half = (length - 3) // 2
    return f"{text[:half]} … {text[len(text) - half :]}"


def quoted(value: object, length: int = 200) -> str:
    """Return the shortened `repr` of a value for a message, at a cost that does not depend on its size."""
    if isinstance(value, str | bytes):
        return repr(shortened(value, length) if isinstance(value, str) else value[:length])
    if isinstance(value, int) and abs(value) > 10**18:
        return "an integer beyond 10^18"
    if isinstance(value, list | tuple) and len(value) > length:
        return f"{type(value).__name__} of {len(value)} entries"
    if isinstance(value, dict) and len(value) > length:
        return f"mapping of {len(value)} keys"
    return shortened(repr(value), length * 2)


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a number with its noun, such as `1 run` and `2 runs`; by default the plural adds an s to the last word."""
    return f"{number} {noun}" if number == 1 else f"{number} {plural or noun + 's'}"


def most_similar(word: str, candidates: Collection[str]) -> str | None:
    """Return the candidate that is most similar to a word; None without one, for a long word or many candidates."""
    if len(word) > _MAX_WORD or len(candidates) > _MAX_CANDIDATES:
        return None
    similar = difflib.get_close_matches(word, candidates, n=1, cutoff=0.6)
    if not similar:
        lowered = {candidate.lower(): candidate for candidate in candidates}
        similar = [lowered[match] for match in difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=0.6)]
    return similar[0] if similar else None


def suggestion(word: object, known: Iterable[str]) -> str:
    """Return a hint for an unknown word: the most similar of `known`, or a list of them if none is similar.

    To limit the cost, no similar word is searched if the word is too long or the known ones are too many.
    """
    candidates = sorted(known)
    if (similar := most_similar(str(word), candidates)) is not None:
        return f"did you mean {similar!r}?"
    if not candidates:
        return "none is known here"
    shown = ", ".join(shortened(name, _MAX_WORD) for name in candidates[:12])
    return f"known: {shown}" + (", …" if len(candidates) > 12 else "")


PASSED = 0
FAILED = 1
"""A criterion failed."""
INVALID_INPUT = 2
"""The input is invalid; nothing was run."""
ABORTED = 3
"""The run was aborted, or reached its time limit."""
NOT_JUDGED = 4
"""The run ended, and no criterion judged it."""
