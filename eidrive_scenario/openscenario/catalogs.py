"""Entries of catalogs: found where the scenario says that its catalogs lie, and read with the values they get."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from eidrive_scenario.errors import Diagnostic, ScenarioError, quoted, shortened, suggestion
from eidrive_scenario.files.bounded import is_folder, is_regular_file
from eidrive_scenario.library import LIBRARY_FOLDER, library_path, place_of
from eidrive_scenario.openscenario.budget import MAX_NESTED_REFERENCES, BudgetError
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import Catalog, CatalogLocations, CatalogReference, Element
from eidrive_scenario.openscenario.reading.document import VERSIONS, version_of
from eidrive_scenario.openscenario.reading.parsing import Document, line_of, open_document
from eidrive_scenario.openscenario.reading.reader import FoundReference, Reader
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.values.parameters import Assignment, Parameter, Scope
from eidrive_scenario.openscenario.values.scalars import Version


@dataclass(frozen=True)
class CatalogFile:
    """A catalog and its entries by name."""

    name: str
    document: Document
    version: Version
    entries: dict[str, etree._Element]
    twins: Mapping[str, Diagnostic]
    """The error for each name that several entries have."""


class CatalogLibrary:
    """The catalogs that a scenario can reach. Each file is read once, each entry once for each set of values.

    An entry should declare the parameters that it uses; where it does not, the scenario's are lent, with a warning.
    """

    def __init__(
        self,
        locations: CatalogLocations | None,
        folder: Path,
        parameters: Mapping[str, Parameter],
        collector: DiagnosticCollector,
    ) -> None:
        self.entries: dict[CatalogReference, Element] = {}
        self._parameters = parameters
        self._collector = collector
        self._places: dict[str, Path] = {}
        for location in locations.children() if locations else ():
            directory = getattr(location, "directory", None)
            if directory is not None and isinstance(directory.path, str):
                kind = type(location).__name__.removesuffix("CatalogLocation")
                self._places[kind] = catalog_place(directory.path, folder)
        self._circular: set[CatalogReference] = set()
        self._files: dict[Path, CatalogFile | None] = {}
        self._unreadable: dict[Path, tuple[Diagnostic, ...]] = {}

    def resolve(self, found: Iterable[FoundReference], active: tuple[tuple[str, str], ...] = ()) -> None:
        """Reads the entries that the references name, and those that these refer to in turn."""
        for one in found:
            reference = one.reference
            names = (reference.catalog_name, reference.entry_name)
            if not all(isinstance(name, str) for name in names):
                continue
            if names in active:
                self._wrong(reference, f"the catalog entry {quoted(names[1])} refers to itself", "break the circle")
                self._circular.add(reference)
                continue
            if len(active) >= MAX_NESTED_REFERENCES:
                self._wrong(reference, f"entries of catalogs are nested more than {len(active)} deep", "flatten them")
                self._circular.add(reference)
                continue
            if reference not in self.entries:
                entry = self._entry(one, (*active, names))
                if entry is not None and reference not in self._circular:
                    self.entries[reference] = entry
            self._check_kind(one)

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each catalog file that an entry was taken from, by the name of the file."""
        used = {entry.source for entry in self.entries.values()}
        documents = [catalog.document for catalog in self._files.values() if catalog is not None]
        return {document.name: document.digest for document in documents if document.name in used}

    def _entry(self, found: FoundReference, active: tuple[tuple[str, str], ...]) -> Element | None:
        reference = found.reference
        catalog = self._catalog(found)
        if catalog is None:
            return None
        node = catalog.entries.get(reference.entry_name)
        if node is None:
            self._wrong(
                reference,
                f"the catalog {quoted(catalog.name)} has no entry {quoted(reference.entry_name)}",
                suggestion(reference.entry_name, catalog.entries),
            )
            return None
        if reference.entry_name in catalog.twins:
            self._collector.errors.append(catalog.twins[reference.entry_name])
            return None
        rule = rules(Catalog, catalog.version).children.get(node.tag)
        if rule is None:
            self._wrong(reference, f"{node.tag} is nothing that a catalog may hold", str(catalog.document.name))
            return None
        try:
            self._collector.budget.enter_catalog_element(sum(1 for _ in node.iter()))
        except BudgetError as error:
            diagnostic = Diagnostic(str(error), "use fewer or smaller entries", reference.source, reference.line)
            raise ScenarioError([*self._collector.errors, diagnostic]) from error
        reader = Reader(catalog.document.name, catalog.version, self._collector)
        lent = Scope(parameters=dict(self._parameters), lent=set(), budget=self._collector.budget)
        entry = reader.read(node, rule.cls, _assignments(reference), lent)
        for name in sorted(lent.lent or ()):
            self._collector.warning(
                f"the catalog entry {quoted(reference.entry_name)} uses the scenario's parameter {quoted(name)}",
                "declare it in the entry and assign it where the entry is used",
                source=entry.source,
                line=entry.line,
            )
        self.resolve(reader.references, active)
        return entry

    def _check_kind(self, found: FoundReference) -> None:
        entry = self.entries.get(found.reference)
        if entry is not None and not isinstance(entry, found.kinds):
            wanted = " or ".join(kind.__name__ for kind in found.kinds)
            self._wrong(
                found.reference,
                f"the catalog entry {quoted(found.reference.entry_name)} is of the kind {type(entry).__name__}",
                f"{wanted} is wanted here",
            )

    def _catalog(self, found: FoundReference) -> CatalogFile | None:
        """The catalog of that name: a file of the name first, then any that says so within."""
        name = found.reference.catalog_name
        places = self._ordered_places(found.kinds)
        if not places:
            wanted = " or ".join(f"{kind.__name__}Catalog" for kind in found.kinds)
            self._wrong(found.reference, f"no place is given for the catalog {quoted(name)}", f"add {wanted}")
            return None
        catalogs: dict[Path, CatalogFile] = {}
        unreadable: list[Diagnostic] = []
        for path in _candidates(places, name):
            catalog = self._file(path)
            if catalog is not None and catalog.name == name:
                self._collector.warnings.extend(unreadable)
                return catalog
            if catalog is not None:
                catalogs[path] = catalog
            unreadable += self._unreadable.get(path, ())
        if unreadable:
            self._collector.errors.extend(unreadable)
            return None
        for path, catalog in catalogs.items():
            if path.stem == name:
                message = f"the catalog in {path.name} is named {quoted(catalog.name)}"
                line = line_of(catalog.document.root)
                self._collector.warning(message, f"name it {quoted(name)}", source=catalog.document.name, line=line)
                return catalog
        beside = self._beside(name)
        if beside is not None:
            place = Path(beside.document.name).parent
            self._collector.warning(
                f"the catalog {quoted(name)} lies in none of the places given, but in {place}",
                f"name that place, {place}",
                source=found.reference.source,
                line=found.reference.line,
            )
            return beside
        self._wrong(found.reference, *_nowhere(name, places, {catalog.name for catalog in catalogs.values()}))
        return None

    def _beside(self, name: str) -> CatalogFile | None:
        """The catalog in a folder beside those that are given, which files find that were moved in parts."""
        folders = {
            folder
            for place in self._places.values()
            if is_folder(place)
            for folder in _entries(place.parent)
            if is_folder(folder) and folder not in self._places.values()
        }
        for folder in sorted(folders):
            path = folder / f"{name}.xosc"
            catalog = self._file(path) if is_regular_file(path) else None
            self._collector.errors.extend(self._unreadable.get(path, ()))
            if catalog is not None and catalog.name == name:
                return catalog
        return None

    def _ordered_places(self, kinds: Iterable[type[Element]]) -> list[Path]:
        """Where catalogs of these kinds lie, then all other places: not every author keeps them apart."""
        own = [self._places[kind.__name__] for kind in kinds if kind.__name__ in self._places]
        return list(dict.fromkeys([*own, *self._places.values()]))

    def _file(self, path: Path) -> CatalogFile | None:
        """The catalog in a file, or None if it has none or cannot be read; `_unreadable` has what is wrong with it."""
        if path not in self._files:
            collector = DiagnosticCollector()
            try:
                self._files[path] = _read(path, collector)
            except ScenarioError as error:
                collector.errors.extend(error.diagnostics)
                self._files[path] = None
            self._collector.warnings.extend(collector.warnings)
            if collector.errors:
                self._unreadable[path] = tuple(collector.errors)
        return self._files[path]

    def _wrong(self, reference: CatalogReference, message: str, hint: str) -> None:
        self._collector.error(message, hint, source=reference.source, line=reference.line)


def _entries(folder: Path) -> list[Path]:
    """The entries of a folder; none of one that may be passed through and not listed."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def catalog_place(directory: str, folder: Path) -> Path:
    """The folder or file that a Directory names; `eidrive_library/catalogs` is the library's from any folder."""
    return place_of(directory.replace("\\", "/"), folder)


def _read(path: Path, collector: DiagnosticCollector) -> CatalogFile | None:
    document = open_document(path)
    catalog = document.root.find("Catalog")
    if catalog is None:
        return None
    version = version_of(document, collector, older=VERSIONS[0])
    if version is None:
        return None
    catalog = apply_workarounds(catalog, document.name, version, collector)
    entries = {child.get("name", ""): child for child in reversed(list(catalog.iterchildren(etree.Element)))}
    return CatalogFile(catalog.get("name", path.stem), document, version, entries, twins_in(catalog, document.name))


def twins_in(catalog: etree._Element, source: str) -> dict[str, Diagnostic]:
    """Return an error for each name that several entries of a catalog have, at the second of them."""
    first: dict[str, etree._Element] = {}
    found: dict[str, Diagnostic] = {}
    for child in catalog.iterchildren(etree.Element):
        name = child.get("name")
        if name is None or first.setdefault(name, child) is child or name in found:
            continue
        message = f"the catalog has a second entry {name!r}; the first is at line {line_of(first[name])}"
        found[name] = Diagnostic(message, "give each entry its own name", source, line_of(child))
    return found


def _nowhere(name: str, places: Iterable[Path], known: set[str]) -> tuple[str, str]:
    """What is wrong where a catalog is in none of the places given, and what would be right."""
    gone = [shortened(str(place), 300) for place in places if not os.path.exists(place)]
    message = f"no catalog {quoted(name)} in " + ", ".join(shortened(str(place), 300) for place in places)
    if gone:
        hint = "correct the Directory"
        if is_regular_file(library_path() / "catalogs" / f"{name}.xosc"):
            hint += f"; that of the library is {LIBRARY_FOLDER}/catalogs"
        return f"{message}; {', '.join(gone)} {'is' if len(gone) == 1 else 'are'} not there", hint
    return message, suggestion(name, known)


def _assignments(reference: CatalogReference) -> dict[str, Assignment]:
    given = reference.parameter_assignments
    return {
        one.parameter_ref: Assignment(one.value, Diagnostic("", "", one.source, one.line))
        for one in (given.parameter_assignment if given else ())
        if isinstance(one.parameter_ref, str) and isinstance(one.value, str)
    }


def _candidates(places: Iterable[Path], name: str) -> Iterator[Path]:
    """Files that may hold a catalog of that name, the likely ones first."""
    for place in places:
        if is_regular_file(place):
            yield place
        elif is_folder(place):
            files = sorted(place.glob("*.xosc"))
            yield from sorted(files, key=lambda file: file.stem != name)
