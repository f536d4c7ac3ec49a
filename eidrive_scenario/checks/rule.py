"""Rules of `eidrive check`: name, level, summary and the function that finds violations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Generic, TypeVar

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import Element

S = TypeVar("S", contravariant=True)


class Level(Enum):
    """Severity of a diagnostic: an error prevents a run, a warning is probably a mistake, a note may be intended."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Rule(Generic[S]):
    """One rule of `eidrive check`.

    name     key in docs/checks.md and argument of `--ignore`
    summary  what violates the rule, in a few words
    check    yields the violations in a lint context
    """

    name: str
    level: Level
    summary: str
    check: Callable[[S], Iterable[Diagnostic]]

    def run(self, context: S) -> Iterator[Diagnostic]:
        """Yield the diagnostics of the rule, with its name."""
        for diagnostic in self.check(context):
            yield replace(diagnostic, rule=self.name)


def at(element: Element, message: str, hint: str = "") -> Diagnostic:
    """Return a diagnostic with the location of an element."""
    return Diagnostic(message, hint, element.source, element.line)
