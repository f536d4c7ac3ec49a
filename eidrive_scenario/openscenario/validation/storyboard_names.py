"""Names within the storyboard, and references to them: by the name alone, or with those above it, as in `act/event`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import (
    Act,
    Action,
    CatalogReference,
    Element,
    Event,
    Maneuver,
    ManeuverGroup,
    Story,
    Storyboard,
    StoryboardElementStateCondition,
    StoryboardElementType,
)

T = TypeVar("T")

SEPARATOR = re.compile(r"::|/")
"""The standard writes ::, many files a slash."""

LEVELS: Mapping[type[Element], StoryboardElementType] = {
    Story: StoryboardElementType.STORY,
    Act: StoryboardElementType.ACT,
    ManeuverGroup: StoryboardElementType.MANEUVER_GROUP,
    Maneuver: StoryboardElementType.MANEUVER,
    Event: StoryboardElementType.EVENT,
    Action: StoryboardElementType.ACTION,
}


@dataclass(frozen=True)
class NamedElement:
    """An element of the storyboard and the names from the story down to it."""

    element: Element
    path: tuple[str, ...]

    @property
    def level(self) -> StoryboardElementType:
        """Story, act, maneuver group, maneuver, event or action."""
        return LEVELS[type(self.element)]


class StoryboardNames:
    """The named elements of a storyboard, with the maneuvers that come from catalogs."""

    def __init__(self, storyboard: Storyboard | None, entries: Mapping[CatalogReference, Element]) -> None:
        self._entries = entries
        self.named = [named for story in (storyboard.story if storyboard else ()) for named in self._below(story, ())]
        self._meant = ReferenceMatch((named.path, named) for named in self.named)

    def _below(self, element: Element, above: tuple[str, ...]) -> Iterator[NamedElement]:
        path = (*above, str(getattr(element, "name", "")))
        yield NamedElement(element, path)
        for child in element.children():
            if isinstance(child, CatalogReference):
                entry = self._entries.get(child)
                if isinstance(entry, Maneuver):
                    yield from self._below(entry, path)
            elif type(child) in LEVELS:
                yield from self._below(child, path)

    def check_unique(self, collector: DiagnosticCollector) -> None:
        """Warns of elements of one kind that have the same name side by side: a reference could mean either."""
        seen: dict[tuple[StoryboardElementType, tuple[str, ...]], Element] = {}
        for named in self.named:
            key = (named.level, named.path)
            other = seen.setdefault(key, named.element)
            if other is not named.element:
                collector.warning(
                    f"two elements of the kind {named.level.value} are named {named.path[-1]!r}",
                    f"the other stands in line {other.line}",
                    source=named.element.source,
                    line=named.element.line,
                )

    def check_reference(self, condition: StoryboardElementStateCondition, collector: DiagnosticCollector) -> None:
        """Reports a condition on an element that is not there, or is of another kind."""
        reference: str | None = condition.storyboard_element_ref
        wanted: StoryboardElementType | None = condition.storyboard_element_type
        if reference is None or wanted is None:
            return
        found = self._meant.by(reference)
        if any(named.level is wanted for named in found):
            return
        if found:
            message = f"{reference!r} is of the kind {found[0].level.value}, not {wanted.value}"
            hint = f"write storyboardElementType={found[0].level.value!r}"
        else:
            message = f"storyboardElementRef names the {wanted.value} {reference!r}, which is not there"
            hint = suggestion(reference, {named.path[-1] for named in self.named if named.level is wanted})
        collector.error(message, hint, source=condition.source, line=condition.line)


class ReferenceMatch(Generic[T]):
    """Elements with their paths, to be asked which of them a reference means."""

    def __init__(self, elements: Iterable[tuple[tuple[str, ...], T]]) -> None:
        self._by_name: dict[str, list[tuple[int, tuple[str, ...], T]]] = {}
        for number, (path, element) in enumerate(elements):
            self._by_name.setdefault(path[-1], []).append((number, path, element))

    def by(self, reference: str) -> list[T]:
        """Those that are meant, in the order in which they were given."""
        last = [name for name in SEPARATOR.split(reference) if name][-1:]
        found = {
            number: element
            for name in {reference, *last}
            for number, path, element in self._by_name.get(name, ())
            if is_suffix(reference, path)
        }
        return [found[number] for number in sorted(found)]


def is_suffix(reference: str, path: tuple[str, ...]) -> bool:
    """Whether a reference means the element of this path: its name, with as many of those above as need be.

    Names in between may be left out; a name may itself hold a separator.
    """
    if reference == path[-1]:
        return True
    names = [name for name in SEPARATOR.split(reference) if name]
    if not names or names[-1] != path[-1]:
        return False
    above = iter(path[:-1])
    return all(name in above for name in names[:-1])
