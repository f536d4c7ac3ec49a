"""Everything that this package raises on purpose.

EidriveError
├── InputError           what a person typed is wrong: one or many Problems, each with file, line and remedy
│   ├── ScenarioError    an OpenSCENARIO file
│   │   └── ConstraintError  a parameter's value is one that the file itself rules out
│   ├── RoadError        an OpenDRIVE file
│   └── SettingError     an option, a controller's property, a channel profile
├── RegistryError        two extensions claim one name, or one does not load
└── SimulationError      the run itself broke
    ├── ExtensionError   an extension raised an exception or returned something invalid
    └── WallLimitError   a run took longer than its limit of wall time
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

MAX_DIAGNOSTICS = 200
"""Maximum number of diagnostics of one kind that are collected for one file."""
MAX_TEXT = 1000
"""Maximum number of characters of a message."""
_MAX_WORD = 100
"""Maximum number of characters of a word that is compared with others."""
_MAX_CANDIDATES = 2000
"""Maximum number of words that a misspelt one is compared with."""


@dataclass(frozen=True)
class Diagnostic:
    """One thing that is wrong with an input, where it stands, and what would be right."""

    message: str
    hint: str = ""
    source: str = ""
    line: int | None = None
    rule: str = ""
    """Which rule of `eidrive check` found it, where one did; docs/checks.md says more about it."""

    def __post_init__(self) -> None:
        if len(self.message) > MAX_TEXT or len(self.hint) > MAX_TEXT:
            object.__setattr__(self, "message", shortened(self.message))
            object.__setattr__(self, "hint", shortened(self.hint))

    def __str__(self) -> str:
        place = f"{self.source}:{self.line}" if self.line is not None else self.source
        head = f"{place}: {self.message}" if place else self.message
        return f"{head}; {self.hint}" if self.hint else head


class EidriveError(Exception):
    """Base of all errors of this package."""


class InputError(EidriveError):
    """Invalid input. `diagnostics` holds all diagnostics in the order of the file."""

    def __init__(self, diagnostics: Diagnostic | Sequence[Diagnostic]) -> None:
        self.diagnostics: tuple[Diagnostic, ...] = (
            (diagnostics,) if isinstance(diagnostics, Diagnostic) else tuple(diagnostics)
        )
        super().__init__("\n".join(str(diagnostic) for diagnostic in self.diagnostics))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Diagnostic, ...]]]:
        return type(self), (self.diagnostics,)


class ScenarioError(InputError):
    """An OpenSCENARIO file is wrong."""


class ConstraintError(ScenarioError):
    """Parameters have values that their constraints rule out, and nothing else is wrong.

    The standard has such a scenario not evaluated: one run of many is left out, not failed.
    """


class RoadError(InputError):
    """An OpenDRIVE file is wrong."""


class SettingError(InputError):
    """An option, a controller's property or a profile is wrong."""


class RegistryError(EidriveError):
    """Two extensions claim one name, or an extension does not load."""


class SimulationError(EidriveError):
    """The run itself broke."""

    def as_json(self) -> dict[str, Any]:
        """Return what `--json` prints of a run that was aborted by this error."""
        return {"kind": "run", "message": str(self)}


@dataclass(frozen=True)
class ExtensionPlace:
    """An extension at work: what it is, for whom, when, and the line of its code.

    kind      singular of the entry-point group (detector, planner, …), or observer
    name      of the entry point; of an observer, its class
    value     module and object of the entry point
    subject   for whom it was called: station 'Ego', actor 'Ego', or the place of an element in the file
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
        place = f"{self.file}:{self.line}: " if self.file else ""
        value = f" ({self.value})" if self.value else ""
        subject = f" of {self.subject}" if self.subject else ""
        time = f" at t = {self.time:.3f} s" if self.time is not None else ""
        return f"{place}{self.kind} {self.name!r}{value}{subject}{time}"

    def as_json(self) -> dict[str, Any]:
        """Return the fields with their names, without those that are not known."""
        return {key: value for key, value in asdict(self).items() if value not in ("", None)}


class ExtensionError(SimulationError):
    """An extension raised an exception or returned something invalid; `place` says which one and where."""

    def __init__(self, place: ExtensionPlace, description: str) -> None:
        super().__init__(f"{place}: {description}")
        self.place = place
        self.description = description

    def __reduce__(self) -> tuple[type[ExtensionError], tuple[ExtensionPlace, str]]:
        return type(self), (self.place, self.description)

    def as_json(self) -> dict[str, Any]:
        return {**super().as_json(), **self.place.as_json(), "problem": self.description}


class WallLimitError(SimulationError):
    """A run or a check took longer than its limit of wall time.

    limit   [s] of wall time
    place   the extension that was running; None if none was
    time    simulated time [s] that the run had reached; None before the run
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
        place = {"kind": "run", "time": self.time} if self.place is None else self.place.as_json()
        return {**super().as_json(), **place, "wall_limit": self.limit}


class InvalidResult(Exception):
    """An extension returned something that cannot be used; the run reports it as ExtensionError.

    extension  the object whose `method` returned it
    """

    def __init__(self, extension: object, method: str, description: str) -> None:
        super().__init__(f"{method} {description}")
        self.extension = extension
        self.method = method


class ErrorCollector:
    """Collect diagnostics of several independent checks.

    An InputError raised inside `with collector:` ends that block and is stored. `raise_if_any` raises one InputError
    with all stored diagnostics, without duplicates.
    """

    def __init__(self) -> None:
        self._diagnostics: list[Diagnostic] = []

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, InputError):
            return False
        self._diagnostics += error.diagnostics
        return True

    def raise_if_any(self) -> None:
        """Raise InputError if diagnostics are stored, each once."""
        if self._diagnostics:
            raise InputError(list(dict.fromkeys(self._diagnostics)))


def capped(diagnostics: Sequence[Diagnostic]) -> list[Diagnostic]:
    """The first MAX_DIAGNOSTICS of several diagnostics, and one that counts the others."""
    shown = list(diagnostics[:MAX_DIAGNOSTICS])
    if len(diagnostics) > MAX_DIAGNOSTICS:
        shown.append(Diagnostic(f"{len(diagnostics) - MAX_DIAGNOSTICS} more are not listed", "", shown[-1].source))
    return shown


def shortened(text: str, length: int = MAX_TEXT) -> str:
    """A text of at most `length` characters: the middle of a longer one is left out."""
    if len(text) <= length:
        return text
    half = (length - 3) // 2
    return f"{text[:half]} … {text[len(text) - half :]}"


def quoted(value: object, length: int = 200) -> str:
    """A value as a message quotes it: its `repr`, shortened, at a cost that does not depend on its size."""
    if isinstance(value, str | bytes):
        return repr(shortened(value, length) if isinstance(value, str) else value[:length])
    if isinstance(value, int) and abs(value) > 10**18:
        return "an integer beyond 10^18"
    if isinstance(value, list | tuple) and len(value) > length:
        return f"{type(value).__name__} of {len(value)} entries"
    if isinstance(value, dict) and len(value) > length:
        return f"mapping of {len(value)} keys"
    return shortened(repr(value), length * 2)


def suggestion(word: str, known: Iterable[str]) -> str:
    """What would be right in place of `word`: the nearest of `known`, or all of them when none is near.

    A word that is too long to be a misspelling, or one of too many, is not compared: the cost stays small.
    """
    candidates = sorted(known)
    if len(word) <= _MAX_WORD and len(candidates) <= _MAX_CANDIDATES:
        near = difflib.get_close_matches(word, candidates, n=1, cutoff=0.6)
        if not near:
            lowered = {candidate.lower(): candidate for candidate in candidates}
            near = [lowered[match] for match in difflib.get_close_matches(word.lower(), lowered, n=1, cutoff=0.6)]
        if near:
            return f"did you mean {near[0]!r}?"
    if not candidates:
        return "none is known here"
    shown = ", ".join(shortened(name, _MAX_WORD) for name in candidates[:12])
    return f"known: {shown}" + (", …" if len(candidates) > 12 else "")
