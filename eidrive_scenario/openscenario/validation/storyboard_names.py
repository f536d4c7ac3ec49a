"""Names in the storyboard and references to them, with or without the names above, such as `act/event`."""

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
"""Separators of names in references: `::` in the standard, a slash in many files."""

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
    """Element of the storyboard with its path of names from the story on."""

    element: Element
    path: tuple[str, ...]

    @property
    def level(self) -> StoryboardElementType:
        """Return the level: story, act, maneuver group, maneuver, event or action."""
        return LEVELS[type(self.element)]


class StoryboardNames:
    """Named elements of a storyboard, including maneuvers from catalogs."""

    def __init__(self, storyboard: Storyboard | None, entries: Mapping[CatalogReference, Element]) -> None:
        self._entries = entries
        self.named = [named for story in (storyboard.story if storyboard else ()) for named in self._below(story, ())]
        self._references = ReferenceMatch((named.path, named) for named in self.named)

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
        """Warn of siblings of one kind with the same name, as references to them are ambiguous."""
        seen: dict[tuple[StoryboardElementType, tuple[str, ...]], Element] = {}
        for named in self.named:
            key = (named.level, named.path)
            other = seen.setdefault(key, named.element)
            if other is not named.element:
                collector.warning(
                    f"two elements of the kind {named.level.value} are named {named.path[-1]!r}",
                    f"the other one is in line {other.line}",
                    source=named.element.source,
                    line=named.element.line,
                )

    def check_reference(self, condition: StoryboardElementStateCondition, collector: DiagnosticCollector) -> None:
        """Report a condition on an element that does not exist or is of another kind."""
        reference: str | None = condition.storyboard_element_ref
        level: StoryboardElementType | None = condition.storyboard_element_type
        if reference is None or level is None:
            return
        found = self._references.by(reference)
        if any(named.level is level for named in found):
            return
        if found:
            message = f"storyboardElementRef: {reference!r} is of the kind {found[0].level.value}, not {level.value}"
            hint = f"write storyboardElementType={found[0].level.value!r}"
        else:
            message = f"storyboardElementRef refers to {level.value} {reference!r}, which does not exist"
            hint = suggestion(reference, {named.path[-1] for named in self.named if named.level is level})
        collector.error(message, hint, source=condition.source, line=condition.line)


class ReferenceMatch(Generic[T]):
    """Index of elements by their paths, for the resolution of references."""

    def __init__(self, elements: Iterable[tuple[tuple[str, ...], T]]) -> None:
        self._by_name: dict[str, list[tuple[int, tuple[str, ...], T]]] = {}
        for number, (path, element) in enumerate(elements):
            self._by_name.setdefault(path[-1], []).append((number, path, element))

    def by(self, reference: str) -> list[T]:
        """Return the referenced elements in the order of the index."""
        last = [name for name in SEPARATOR.split(reference) if name][-1:]
        found = {
            number: element
            for name in {reference, *last}
            for number, path, element in self._by_name.get(name, ())
            if is_suffix(reference, path)
        }
        return [found[number] for number in sorted(found)]


def is_suffix(reference: str, path: tuple[str, ...]) -> bool:
    """Whether a reference applies to the element of this path: its name, optionally with names above.

    Intermediate names may be omitted; a name may itself contain a separator.
    """
    if reference == path[-1]:
        return True
    names = [name for name in SEPARATOR.split(reference) if name]
    if not names or names[-1] != path[-1]:
        return False
    above = iter(path[:-1])
    return all(name in above for name in names[:-1])
