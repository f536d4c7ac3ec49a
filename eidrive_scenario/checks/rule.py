"""What a rule is: a name to look it up by, how grave its findings are, and the function that finds them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Generic, TypeVar

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.model import Element

S = TypeVar("S", contravariant=True)


class Level(Enum):
    """How grave a finding is: an error stops a run, a warning is most likely a mistake, a note may be meant so."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Rule(Generic[S]):
    """One rule of `eidrive check`.

    name   by which users look it up in docs/checks.md, and leave it out
    about  what it finds, in a few words
    check  yields its findings in what a survey knows of a scenario
    """

    name: str
    level: Level
    summary: str
    check: Callable[[S], Iterable[Diagnostic]]

    def run(self, context: S) -> Iterator[Diagnostic]:
        """What the rule finds, marked with its name."""
        for diagnostic in self.check(context):
            yield replace(diagnostic, rule=self.name)


def at(element: Element, message: str, hint: str = "") -> Diagnostic:
    """A finding at the place of an element."""
    return Diagnostic(message, hint, element.source, element.line)
