"""Check of names: uniqueness, and existence of the referenced ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import (
    CatalogReference,
    Condition,
    Controller,
    Element,
    MonitorDeclaration,
    ObjectController,
    OpenScenario,
    ParameterAssignment,
    ParameterDeclaration,
    StoryboardElementStateCondition,
    TrafficSignalController,
    Trailer,
    VariableDeclaration,
)
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.scenario_runner import is_criterion
from eidrive_scenario.openscenario.validation.scenario_objects import scenario_objects
from eidrive_scenario.openscenario.validation.storyboard_names import StoryboardNames
from eidrive_scenario.openscenario.values.scalars import Version

_DECLARED_BY: Mapping[type[Element], str] = {
    ParameterDeclaration: "parameter",
    VariableDeclaration: "variable",
    MonitorDeclaration: "monitor",
    TrafficSignalController: "signal controller",
    Controller: "controller",
    ObjectController: "controller",
}
_UNIQUE = ("entity", "variable", "monitor", "signal controller")


def check_names(
    root: OpenScenario,
    elements: Iterable[Element],
    version: Version,
    entries: Mapping[CatalogReference, Element],
    collector: DiagnosticCollector,
) -> None:
    """Report duplicate names and references to missing elements."""
    elements = list(elements)
    known: dict[str, dict[str, Element]] = {kind: {} for kind in ("entity", *_DECLARED_BY.values())}
    unnamed: set[str] = set()
    for kind, name, element in _definitions(root, elements, entries):
        if name is None:
            unnamed.add(kind)
            continue
        if name in known[kind] and kind in _UNIQUE:
            collector.error(
                f"two {_plural(kind)} are named {name!r}",
                f"the other one is in line {known[kind][name].line}; rename one",
                source=element.source,
                line=element.line,
            )
        known[kind].setdefault(name, element)
    complete = {kind: names for kind, names in known.items() if kind not in unnamed}
    exempt = {id(parameter) for element in elements for parameter in _undeclared_parameter(element)}
    exempt |= {
        id(element.trailer_ref) for element in elements if isinstance(element, Trailer) and _has_no_trailer(element)
    }
    storyboard = StoryboardNames(root.storyboard, entries)
    storyboard.check_unique(collector)
    for element in elements:
        if isinstance(element, StoryboardElementStateCondition):
            storyboard.check_reference(element, collector)
        elif not isinstance(element, ParameterAssignment) and id(element) not in exempt:
            _check_references(element, version, complete, collector)


def _definitions(
    root: OpenScenario, elements: Iterable[Element], entries: Mapping[CatalogReference, Element]
) -> Iterator[tuple[str, str | None, Element]]:
    """Yield every defined name with its kind and element; None for a name that could not be read."""
    for one, _ in scenario_objects(root.entities, entries):
        yield "entity", one.name, one
    for selection in root.entities.entity_selection if root.entities else ():
        yield "entity", selection.name, selection
    for element in elements:
        kind = _DECLARED_BY.get(type(element))
        if kind is not None and not (isinstance(element, ObjectController) and element.name is None):
            yield kind, getattr(element, "name", None), element


def _undeclared_parameter(element: Element) -> Iterator[Element]:
    """Yield the ParameterCondition of a criterion of ScenarioRunner, whose parameter need not be declared."""
    if isinstance(element, Condition) and element.by_value_condition is not None and is_criterion(element):
        yield from element.by_value_condition.children()


def _has_no_trailer(trailer: Trailer) -> bool:
    """Whether a trailer has an empty reference, the default of catalog vehicles with a trailer parameter."""
    return trailer.trailer_ref is not None and trailer.trailer_ref.entity_ref == ""


def _check_references(
    element: Element, version: Version, known: Mapping[str, Mapping[str, Element]], collector: DiagnosticCollector
) -> None:
    for spelling, rule in rules(type(element), version).attributes.items():
        kind = rule.points_to
        name = getattr(element, rule.field) if kind in known else None
        if isinstance(name, str) and name not in known[kind]:
            collector.error(
                f"{spelling} of {type(element).__name__} refers to {kind} {name!r}, which does not exist",
                suggestion(name, known[kind]),
                source=element.source,
                line=element.line,
            )


def _plural(kind: str) -> str:
    return "entities" if kind == "entity" else kind + "s"
