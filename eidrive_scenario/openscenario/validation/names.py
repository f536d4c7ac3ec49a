"""Check of names: uniqueness, and existence of the referenced ones.

Names in the storyboard are referenced with or without the names above, such as `act/event`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_criterion
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.values.scalars import Version


def scenario_objects(
    entities: model.Entities | None, entries: Mapping[model.CatalogReference, model.Element]
) -> Iterator[tuple[model.ScenarioObject, model.Element | None]]:
    """Yield every scenario object and its body, trailers after their towing vehicles; None for an unknown body."""
    for towing in entities.scenario_object if entities else ():
        entity: model.ScenarioObject | None = towing
        while entity is not None:
            body: model.Element | None = (
                entity.vehicle
                or entity.pedestrian
                or entity.misc_object
                or entity.external_object_reference
                or entity.sensor
            )
            if body is None and entity.catalog_reference is not None:
                body = entries.get(entity.catalog_reference)
            yield entity, body
            trailer = body.trailer if isinstance(body, model.Vehicle) else None
            entity = trailer.trailer if trailer is not None else None


T = TypeVar("T")

SEPARATOR = re.compile(r"::|/")
"""Separators of names in references: `::` in the standard, a slash in many files."""

LEVELS: Mapping[type[model.Element], model.StoryboardElementType] = {
    model.Story: model.StoryboardElementType.STORY,
    model.Act: model.StoryboardElementType.ACT,
    model.ManeuverGroup: model.StoryboardElementType.MANEUVER_GROUP,
    model.Maneuver: model.StoryboardElementType.MANEUVER,
    model.Event: model.StoryboardElementType.EVENT,
    model.Action: model.StoryboardElementType.ACTION,
}


@dataclass(frozen=True)
class NamedElement:
    """Element of the storyboard with its path of names from the story on."""

    element: model.Element
    path: tuple[str, ...]

    @property
    def level(self) -> model.StoryboardElementType:
        """Return the level: story, act, maneuver group, maneuver, event or action."""
        return LEVELS[type(self.element)]


class StoryboardNames:
    """Named elements of a storyboard, including maneuvers from catalogs."""

    def __init__(
        self, storyboard: model.Storyboard | None, entries: Mapping[model.CatalogReference, model.Element]
    ) -> None:
        self._entries = entries
        self.named = [named for story in (storyboard.story if storyboard else ()) for named in self._below(story, ())]
        self._references = ReferenceMatch((named.path, named) for named in self.named)

    def _below(self, element: model.Element, above: tuple[str, ...]) -> Iterator[NamedElement]:
        path = (*above, str(getattr(element, "name", "")))
        yield NamedElement(element, path)
        for child in element.children():
            if isinstance(child, model.CatalogReference):
                entry = self._entries.get(child)
                if isinstance(entry, model.Maneuver):
                    yield from self._below(entry, path)
            elif type(child) in LEVELS:
                yield from self._below(child, path)

    def check_unique(self, collector: DiagnosticCollector) -> None:
        """Warn of siblings of one kind with the same name, as references to them are ambiguous."""
        seen: dict[tuple[model.StoryboardElementType, tuple[str, ...]], model.Element] = {}
        for named in self.named:
            key = (named.level, named.path)
            other = seen.setdefault(key, named.element)
            if other is not named.element:
                collector.warning(
                    f"two elements of the kind {named.level.value} are named {named.path[-1]!r}",
                    f"the other one is in line {other.line}",
                    at=named.element,
                )

    def check_reference(self, condition: model.StoryboardElementStateCondition, collector: DiagnosticCollector) -> None:
        """Report a condition on an element that does not exist or is of another kind."""
        reference: str | None = condition.storyboard_element_ref
        level: model.StoryboardElementType | None = condition.storyboard_element_type
        if reference is None or level is None:
            return
        matches = self._references.by(reference)
        if any(named.level is level for named in matches):
            return
        if matches:
            message = f"storyboardElementRef: {reference!r} is of the kind {matches[0].level.value}, not {level.value}"
            hint = f"write storyboardElementType={matches[0].level.value!r}"
        else:
            message = f"storyboardElementRef refers to {level.value} {reference!r}, which does not exist"
            hint = suggestion(reference, {named.path[-1] for named in self.named if named.level is level})
        collector.error(message, hint, at=condition)


class ReferenceMatch(Generic[T]):
    """Index of elements by their paths, for the resolution of references."""

    def __init__(self, elements: Iterable[tuple[tuple[str, ...], T]]) -> None:
        self._by_name: dict[str, list[tuple[int, tuple[str, ...], T]]] = {}
        for number, (path, element) in enumerate(elements):
            self._by_name.setdefault(path[-1], []).append((number, path, element))

    def by(self, reference: str) -> list[T]:
        """Return the referenced elements in the order of the index."""
        last = [name for name in SEPARATOR.split(reference) if name][-1:]
        elements = {
            number: element
            for name in {reference, *last}
            for number, path, element in self._by_name.get(name, ())
            if is_suffix(reference, path)
        }
        return [elements[number] for number in sorted(elements)]


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


_DECLARED_BY: Mapping[type[model.Element], str] = {
    model.ParameterDeclaration: "parameter",
    model.VariableDeclaration: "variable",
    model.MonitorDeclaration: "monitor",
    model.TrafficSignalController: "signal controller",
    model.Controller: "controller",
    model.ObjectController: "controller",
}
_UNIQUE = ("entity", "variable", "monitor", "signal controller")


def check_names(
    root: model.OpenScenario,
    elements: Iterable[model.Element],
    version: Version,
    entries: Mapping[model.CatalogReference, model.Element],
    collector: DiagnosticCollector,
) -> None:
    """Report duplicate names and references to missing elements."""
    elements = list(elements)
    declared: dict[str, dict[str, model.Element]] = {kind: {} for kind in ("entity", *_DECLARED_BY.values())}
    unnamed: set[str] = set()
    for kind, name, element in _definitions(root, elements, entries):
        if name is None:
            unnamed.add(kind)
            continue
        if name in declared[kind] and kind in _UNIQUE:
            plural = "entities" if kind == "entity" else f"{kind}s"
            hint = f"the other one is in line {declared[kind][name].line}; rename one"
            collector.error(f"two {plural} are named {name!r}", hint, at=element)
        declared[kind].setdefault(name, element)
    complete = {kind: names for kind, names in declared.items() if kind not in unnamed}
    exempt: set[int] = set()
    for element in elements:
        if isinstance(element, model.Condition) and element.by_value_condition is not None and is_criterion(element):
            # The parameter of a criterion of ScenarioRunner need not be declared
            exempt.update(map(id, element.by_value_condition.children()))
        elif isinstance(element, model.Trailer) and element.trailer_ref and element.trailer_ref.entity_ref == "":
            # The default of catalog vehicles with a trailer parameter: no trailer
            exempt.add(id(element.trailer_ref))
    storyboard = StoryboardNames(root.storyboard, entries)
    storyboard.check_unique(collector)
    for element in elements:
        if isinstance(element, model.StoryboardElementStateCondition):
            storyboard.check_reference(element, collector)
        elif not isinstance(element, model.ParameterAssignment) and id(element) not in exempt:
            _check_references(element, version, complete, collector)


def _definitions(
    root: model.OpenScenario, elements: Iterable[model.Element], entries: Mapping[model.CatalogReference, model.Element]
) -> Iterator[tuple[str, str | None, model.Element]]:
    """Yield every defined name with its kind and element; None for a name that could not be read."""
    for entity, _ in scenario_objects(root.entities, entries):
        yield "entity", entity.name, entity
    for selection in root.entities.entity_selection if root.entities else ():
        yield "entity", selection.name, selection
    for element in elements:
        kind = _DECLARED_BY.get(type(element))
        if kind is not None and not (isinstance(element, model.ObjectController) and element.name is None):
            yield kind, getattr(element, "name", None), element


def _check_references(
    element: model.Element,
    version: Version,
    defined: Mapping[str, Mapping[str, model.Element]],
    collector: DiagnosticCollector,
) -> None:
    for spelling, rule in rules(type(element), version).attributes.items():
        kind = rule.points_to
        name = getattr(element, rule.field) if kind in defined else None
        if isinstance(name, str) and name not in defined[kind]:
            collector.error(
                f"{spelling} of {type(element).__name__} refers to {kind} {name!r}, which does not exist",
                suggestion(name, defined[kind]),
                at=element,
            )
