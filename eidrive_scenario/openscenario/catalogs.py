"""Catalog entries: search in the catalog locations of the scenario, and reading with the assigned parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import msgspec
from lxml import etree

from eidrive_scenario.base.content_digest import sha256_of
from eidrive_scenario.errors import Diagnostic, ScenarioError, quoted, shortened, suggestion
from eidrive_scenario.extensions.library import CATALOGS, LIBRARY_FOLDER, library_path, resolve_path
from eidrive_scenario.files.bounded import is_regular_file, read_regular_file
from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.diagnostics import MAX_NESTED_REFERENCES, BudgetError, DiagnosticCollector, Location
from eidrive_scenario.openscenario.reading.document import VERSIONS, version_of
from eidrive_scenario.openscenario.reading.parsing import LIMITS, Document, open_document
from eidrive_scenario.openscenario.reading.reader import Reader, ReferenceUse
from eidrive_scenario.openscenario.reading.schema import rules
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.values.parameters import Assignment, Parameter, Scope
from eidrive_scenario.openscenario.values.scalars import Version

Listing = tuple[str, ...] | bool
"""Sorted names in a folder; whether anything is at a path that is no folder."""


class CatalogFiles(msgspec.Struct, frozen=True):
    """Files and folders that were read to find the catalog entries of a scenario.

    folders  locations of catalogs with their listings, when reading began
    digests  SHA-256 of each file that was read, as hexadecimal digits
    """

    folders: Mapping[Path, Listing]
    digests: Mapping[Path, str]

    def are_current(self, folders: Mapping[Path, Listing]) -> bool:
        """Return whether the folders have these listings and all files their content."""
        return self.folders == folders and all(_digest(path) == digest for path, digest in self.digests.items())


def listing_of(location: Path) -> Listing:
    """Return what is at the location of catalogs."""
    try:
        return tuple(sorted(os.listdir(location)))
    except OSError:
        return os.path.lexists(location)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file; an empty text if it cannot be read."""
    try:
        return sha256_of(read_regular_file(path, LIMITS.max_bytes))
    except OSError:
        return ""


class CatalogFile(msgspec.Struct, frozen=True):
    """Catalog and its entries by name."""

    name: str
    document: Document
    version: Version
    entries: dict[str, etree._Element]
    duplicates: Mapping[str, Diagnostic]
    """Error for each name that several entries have."""


class CatalogLibrary:
    """Catalogs in the locations of a scenario. Each file is read once, each entry once for each set of values.

    An entry should declare the parameters that it uses; otherwise those of the scenario are used, with a warning.
    """

    def __init__(
        self,
        locations: model.CatalogLocations | None,
        folder: Path,
        parameters: Mapping[str, Parameter],
        collector: DiagnosticCollector,
    ) -> None:
        self.entries: dict[model.CatalogReference, model.Element] = {}
        self._parameters = parameters
        self._collector = collector
        self._locations: dict[str, Path] = {}
        for name, location in vars(locations).items() if locations else ():
            directory = location.directory if isinstance(location, model.CatalogLocation) else None
            if directory and isinstance(directory.path, str):
                kind = name.removesuffix("_catalog").title().replace("_", "")  # As `MiscObject`
                self._locations[kind] = resolve_path(directory.path, folder)
        self.folders: dict[Path, Listing] = {path: listing_of(path) for path in self._locations.values()}
        """Locations of catalogs with their listings, before any file in them is read."""
        self._is_complete = True
        self._circular: set[model.CatalogReference] = set()
        self._files: dict[Path, CatalogFile | None] = {}
        self._unreadable: dict[Path, tuple[Diagnostic, ...]] = {}

    def resolve(self, uses: Iterable[ReferenceUse], active: tuple[tuple[str, str], ...] = ()) -> None:
        """Read the referenced entries, and recursively those to which they refer."""
        for use in uses:
            reference = use.reference
            names = (reference.catalog_name, reference.entry_name)
            if not all(isinstance(name, str) for name in names):
                continue
            message, hint = "", ""
            if names in active:
                message, hint = f"catalog entry {quoted(names[1])} refers to itself", "remove the circular reference"
            elif len(active) >= MAX_NESTED_REFERENCES:
                message, hint = f"catalog entries are nested deeper than {len(active)} levels", "flatten them"
            if message:
                self._collector.error(message, hint, at=reference)
                self._circular.add(reference)
                continue
            if reference not in self.entries:
                entry = self._read_entry(use, (*active, names))
                if entry is not None and reference not in self._circular:
                    self.entries[reference] = entry
            kept = self.entries.get(reference)
            if kept is not None and not isinstance(kept, use.kinds):
                message = f"catalog entry {quoted(names[1])} is a {type(kept).__name__}"
                expected = " or ".join(kind.__name__ for kind in use.kinds)
                self._collector.error(message, f"expected {expected}", at=reference)

    @property
    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of each catalog file of which an entry is used, by name of the file."""
        used = {entry.source for entry in self.entries.values()}
        documents = [catalog.document for catalog in self._files.values() if catalog is not None]
        return {document.name: document.digest for document in documents if document.name in used}

    @property
    def files(self) -> CatalogFiles | None:
        """Return all that was read; None if some file was unreadable or outside the given locations."""
        catalogs = {path: catalog for path, catalog in self._files.items() if catalog is not None}
        if not self._is_complete or len(catalogs) < len(self._files):
            return None
        return CatalogFiles(self.folders, {path: catalog.document.digest for path, catalog in catalogs.items()})

    def _read_entry(self, use: ReferenceUse, active: tuple[tuple[str, str], ...]) -> model.Element | None:
        reference = use.reference
        catalog = self._catalog(use)
        if catalog is None:
            return None
        name = reference.entry_name
        node = catalog.entries.get(name)
        if node is None:
            message = f"catalog {quoted(catalog.name)} has no entry {quoted(name)}"
            self._collector.error(message, suggestion(name, catalog.entries), at=reference)
            return None
        if name in catalog.duplicates:
            self._collector.errors.append(catalog.duplicates[name])
            return None
        rule = rules(model.Catalog, catalog.version).children.get(node.tag)
        if rule is None:
            message = f"catalog entry {quoted(name)} is a {node.tag}, which is not allowed in a catalog"
            self._collector.error(message, f"remove it from {catalog.document.name}:{line_of(node)}", at=reference)
            return None
        try:
            self._collector.budget.enter_catalog_element(sum(1 for _ in node.iter()))
        except BudgetError as error:
            diagnostic = Diagnostic.at(reference, str(error), "use fewer or smaller entries")
            raise ScenarioError([*self._collector.errors, diagnostic]) from error
        reader = Reader(catalog.document.name, catalog.version, self._collector, catalog.document.read)
        lent = Scope(parameters=dict(self._parameters), lent=set(), budget=self._collector.budget)
        entry = reader.read(node, rule.cls, _assignments(reference, self._collector), lent)
        for parameter in sorted(lent.lent or ()):
            message = f"catalog entry {quoted(name)} uses the parameter {quoted(parameter)} of the scenario"
            hint = "declare it in the entry, and assign it in the CatalogReference"
            self._collector.warning(message, hint, at=entry)
        self.resolve(reader.references, active)
        return entry

    def _catalog(self, use: ReferenceUse) -> CatalogFile | None:
        """Return the catalog of that name: first in a file of that name, then in any other file."""
        name = use.reference.catalog_name
        locations = self._ordered_locations(use.kinds)
        if not locations:
            expected = " or ".join(f"{kind.__name__}Catalog" for kind in use.kinds)
            message = f"catalog {quoted(name)} has no location in CatalogLocations"
            self._collector.error(message, f"add {expected}", at=use.reference)
            return None
        catalogs: dict[Path, CatalogFile] = {}
        unreadable: list[Diagnostic] = []
        for path in _candidates(locations, name):
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
                self._collector.warning(message, f"name it {quoted(name)}", at=Location(catalog.document.name, line))
                return catalog
        beside = self._beside(name)
        if beside is not None:
            parent = Path(beside.document.name).parent
            message = f"catalog {quoted(name)} is not in the given folders, but in {parent}"
            self._collector.warning(message, f"specify the folder {parent}", at=use.reference)
            return beside
        message, hint = _missing_catalog(name, locations, {catalog.name for catalog in catalogs.values()})
        self._collector.error(message, hint, at=use.reference)
        return None

    def _beside(self, name: str) -> CatalogFile | None:
        """Return the catalog from a sibling of the given folders; this finds it if only some files were moved."""
        self._is_complete = False
        folders: set[Path] = set()
        for location in filter(os.path.isdir, self._locations.values()):
            with suppress(OSError):  # A folder that cannot be listed
                folders.update(filter(os.path.isdir, location.parent.iterdir()))
        folders -= set(self._locations.values())
        for folder in sorted(folders):
            path = folder / f"{name}.xosc"
            catalog = self._file(path) if is_regular_file(path) else None
            self._collector.errors.extend(self._unreadable.get(path, ()))
            if catalog is not None and catalog.name == name:
                return catalog
        return None

    def _ordered_locations(self, kinds: Iterable[type[model.Element]]) -> list[Path]:
        """Return the folders for these kinds, then all others, as files may use one folder for several kinds."""
        own = [self._locations[kind.__name__] for kind in kinds if kind.__name__ in self._locations]
        return list(dict.fromkeys([*own, *self._locations.values()]))

    def _file(self, path: Path) -> CatalogFile | None:
        """Return the catalog in a file; None if it has none or is unreadable, with the errors in `_unreadable`."""
        if path not in self._files:
            collector = DiagnosticCollector()
            try:
                self._files[path] = _read(path, collector)
            except ScenarioError as error:
                collector.errors.extend(error.diagnostics)
                self._files[path] = None
            self._collector.warnings.extend(collector.warnings)
            self._collector.unlisted_warnings += collector.unlisted_warnings
            if collector.errors:
                self._unreadable[path] = tuple(collector.errors)
        return self._files[path]


def _read(path: Path, collector: DiagnosticCollector) -> CatalogFile | None:
    document = open_document(path)
    catalog = document.root.find("Catalog")
    if catalog is None:
        return None
    version = version_of(document, collector, older=VERSIONS[0])
    if version is None:
        return None
    # Errors of the header are warnings here, as the entries do not depend on it
    header = DiagnosticCollector()
    for node in document.root.iterchildren("FileHeader"):
        Reader(document.name, version, header).read(node, model.FileHeader)
    collector.warnings += header.errors + header.warnings
    repaired = apply_workarounds(catalog, document.name, version, collector)
    if repaired is not catalog:
        catalog, document = repaired, msgspec.structs.replace(document, read=None)
    entries = {child.get("name", ""): child for child in reversed(list(catalog.iterchildren(etree.Element)))}
    return CatalogFile(
        catalog.get("name", path.stem), document, version, entries, duplicate_entries(catalog, document.name)
    )


def duplicate_entries(catalog: etree._Element, source: str) -> dict[str, Diagnostic]:
    """Return an error for each name that several entries of a catalog have, at the second of them."""
    first: dict[str, etree._Element] = {}
    entries: dict[str, Diagnostic] = {}
    for child in catalog.iterchildren(etree.Element):
        name = child.get("name")
        if name is None or first.setdefault(name, child) is child or name in entries:
            continue
        message = f"the catalog has a second entry {name!r}; the first is at line {line_of(first[name])}"
        entries[name] = Diagnostic(message, "use unique names", source, line_of(child))
    return entries


def _missing_catalog(name: str, locations: Iterable[Path], names: set[str]) -> tuple[str, str]:
    """Return message and hint for a catalog that is not in the given folders."""
    missing = [shortened(str(location), 300) for location in locations if not os.path.exists(location)]
    message = f"no catalog {quoted(name)} in " + ", ".join(shortened(str(location), 300) for location in locations)
    if missing:
        hint = "correct the Directory"
        if is_regular_file(library_path() / CATALOGS / f"{name}.xosc"):
            hint += f"; that of the library is {LIBRARY_FOLDER}/{CATALOGS}"
        return f"{message}; {', '.join(missing)} {'does' if len(missing) == 1 else 'do'} not exist", hint
    return message, suggestion(name, names)


def _assignments(reference: model.CatalogReference, collector: DiagnosticCollector) -> dict[str, Assignment]:
    assigned: dict[str, Assignment] = {}
    assignments = reference.parameter_assignments
    for assignment in assignments.parameter_assignment if assignments else ():
        name, value = assignment.parameter_ref, assignment.value
        if isinstance(name, str) and isinstance(value, str):
            if name in assigned:
                collector.error(f"CatalogReference assigns {quoted(name)} twice", "remove one", at=assignment)
            assigned[name] = Assignment(value, Location.of(assignment))
    return assigned


def _candidates(locations: Iterable[Path], name: str) -> Iterator[Path]:
    """Yield files that may contain a catalog of that name, those with this file name first."""
    for location in locations:
        if is_regular_file(location):
            yield location
        elif os.path.isdir(location):
            files = sorted(location.glob("*.xosc"))
            yield from sorted(files, key=lambda file: file.stem != name)
