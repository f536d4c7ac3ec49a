"""Scenario that was read and validated, its road file and its entity selections: the input of all higher layers."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

from eidrive_scenario.errors import Diagnostic, ScenarioError, shortened, suggestion
from eidrive_scenario.extensions.library import ROADS_SUFFIX, from_library, resolve_path
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.catalogs import CatalogFiles, CatalogLibrary
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.document import read_root
from eidrive_scenario.openscenario.reading.parsing import Source, open_document
from eidrive_scenario.openscenario.validation.names import scenario_objects
from eidrive_scenario.openscenario.validation.rules import check_rules
from eidrive_scenario.openscenario.values.parameters import Assignment, Scope, as_assignments

MAPS = "EIDRIVE_MAPS"
"""Environment variable with the folders in which a road file is searched by its name."""


def find_road_file(network: model.RoadNetwork | None, folder: Path, collector: DiagnosticCollector) -> Path | None:
    """Return the road file of a scenario; None if it has none.

    The file is searched relative to the scenario, then by its name beside the scenario, which is a warning, and in the
    folders of EIDRIVE_MAPS. A name without a suffix, such as Town01, is completed to Town01.xodr.
    """
    logic = network.logic_file if network else None
    if logic is None or not isinstance(logic.filepath, str) or not logic.filepath.strip():
        return None
    stated, subject = Path(logic.filepath.strip().replace("\\", "/")), f"road file '{shortened(logic.filepath, 300)}'"
    map_folders = [Path(entry) for entry in os.environ.get(MAPS, "").split(os.pathsep) if entry]
    for path in (stated, stated.with_name(stated.name + ROADS_SUFFIX)) if stated.name else ():
        candidate = resolve_path(str(path), folder)
        if is_regular_file(candidate):
            return candidate
        for directory in (folder, *map_folders):
            candidate = directory / path.name
            if is_regular_file(candidate):
                if candidate.parent == folder:
                    message = f"{subject} does not exist; that beside the scenario is used"
                    collector.warning(message, f"write {candidate.name!r}", at=logic)
                return candidate
    folders = filter(os.path.isdir, [(folder / stated).parent, *map_folders])
    maps = {file.stem for directory in folders for file in directory.glob(f"*{ROADS_SUFFIX}")}
    hint = f"check LogicFile, or set {MAPS} to the folders of the maps"
    if maps:
        hint = suggestion(stated.name.removesuffix(ROADS_SUFFIX), maps)
    # Relative paths in a scenario without a file are relative to the current folder
    base = "in the current folder" if folder == Path() else "in the folder of the scenario"
    collector.error(f"{subject} is neither {base} nor in the folders of {MAPS}", hint, at=logic)
    return None


EntityObject: TypeAlias = model.Vehicle | model.Pedestrian | model.MiscObject

_OBJECT_TYPES: Mapping[type[EntityObject], model.ObjectType] = {
    model.Vehicle: model.ObjectType.VEHICLE,
    model.Pedestrian: model.ObjectType.PEDESTRIAN,
    model.MiscObject: model.ObjectType.MISCELLANEOUS,
}


@dataclass(frozen=True, eq=False)
class Scenario:
    """Scenario with parameters substituted and catalog references resolved.

    name         name of the file without its suffix; without a file, the description of the header in one line
    version      version of the standard in the header, such as (1, 3)
    parameters   parameters of the scenario, with their final values
    variables    variables of the scenario, with their initial values
    entities     entities by name, including trailers; catalog references resolved
    external     entities with an ExternalObjectReference; their bodies in `entities` have no size
    controllers  controllers of each entity in the order of the file; catalog references resolved
    road_file    path of the OpenDRIVE file; None if the scenario has none
    text         content of a scenario without a file
    warnings     warnings of the reader, such as deprecated elements
    source       source of this scenario, to load it again with other values
    assigned     parameter values of the caller; they take precedence over drawn ones
    digest       SHA-256 of the content, as hexadecimal digits
    catalogs     SHA-256 of each used catalog file, by its path
    catalog_files  all that was read to find catalog entries; None if it cannot be compared with that of later readings
    scope        parameters with their types, for references in settings outside the file
    driven       entities to which the settings of a run give a driving stack; actions cannot switch its controller
    """

    name: str
    path: Path | None
    version: tuple[int, int]
    document: model.OpenScenario
    parameters: Mapping[str, str]
    variables: Mapping[str, str]
    entities: Mapping[str, EntityObject]
    controllers: Mapping[str, tuple[model.Controller, ...]]
    road_file: Path | None
    warnings: tuple[Diagnostic, ...]
    external: Mapping[str, model.ExternalObjectReference]
    entries: Mapping[model.CatalogReference, model.Element] = field(repr=False)
    text: bytes | None = field(repr=False, default=None)
    source: Source = field(repr=False, default=b"")
    assigned: Mapping[str, Assignment] = field(repr=False, default_factory=dict)
    digest: str = ""
    catalogs: Mapping[str, str] = field(default_factory=dict)
    catalog_files: CatalogFiles | None = field(repr=False, default=None)
    scope: Scope | None = field(repr=False, default=None)
    driven: frozenset[str] = frozenset()

    @property
    def storyboard(self) -> model.Storyboard:
        """Return the storyboard."""
        assert self.document.storyboard is not None
        return self.document.storyboard

    @property
    def parameter_types(self) -> dict[str, model.ParameterType]:
        """Return the types of the parameters by name."""
        declared = self.document.parameter_declarations
        declarations = () if declared is None else declared.parameter_declaration
        return {parameter.name: parameter.parameter_type for parameter in declarations}

    @cached_property
    def custom_commands(self) -> tuple[model.CustomCommandAction, ...]:
        """Return all CustomCommandActions of the storyboard in the order of the file."""
        return tuple(element for element in self.storyboard.walk() if isinstance(element, model.CustomCommandAction))

    @cached_property
    def entities_by_type(self) -> Mapping[model.ObjectType, tuple[str, ...]]:
        """Return the names of the entities of each type in the order of the file; external objects are a type."""
        entities: dict[model.ObjectType, tuple[str, ...]] = {}
        for name, entity in self.entities.items():
            kind = model.ObjectType.EXTERNAL if name in self.external else _OBJECT_TYPES[type(entity)]
            entities[kind] = (*entities.get(kind, ()), name)
        return entities

    def resolved(self, reference: model.CatalogReference) -> model.Element:
        """Return the catalog entry with the parameters that the reference assigns."""
        return self.entries[reference]


def load_scenario(source: Source, parameters: Mapping[str, str | Assignment] | None = None) -> Scenario:
    """Read a scenario, with other values for its parameters.

    source      path of a file, or library name of a scenario; the bytes of a file; an XML tree of lxml or
                ElementTree; or an object whose `get_element()` returns such a tree, such as a Scenario of
                scenariogeneration. Relative paths in a scenario without a file are relative to the current folder
    parameters  values by name; an Assignment also has the file and line of the value

    Raise ScenarioError with all errors of the file and its catalogs, each with file and line; ConstraintError if all
    errors are parameter values that violate their constraints.
    """
    if isinstance(source, str | os.PathLike):
        source = from_library(source)
    document = open_document(source)
    collector = DiagnosticCollector()
    assignments = as_assignments(parameters)
    read = read_root(document, collector, assignments)
    if read is None or read.root.catalog is not None or read.root.parameter_value_distribution is not None:
        if read is None or not assignments:
            collector.raise_on_error()
        assert read is not None  # an unknown version is an error
        raise ScenarioError(_other_kind(read.root, document.name))  # before errors of the assigned parameters
    root = read.root
    library = CatalogLibrary(root.catalog_locations, document.folder, read.parameters, collector)
    library.resolve(read.references)
    road_file = find_road_file(root.road_network, document.folder, collector)
    check_rules(root, read.version, library.entries, collector)
    warnings = collector.raise_on_error()
    objects = list(scenario_objects(root.entities, library.entries))
    return Scenario(
        name=document.path.stem if document.path else " ".join(root.file_header.description.split()) or document.name,
        path=document.path,
        version=read.version,
        document=root,
        parameters=_values(root.parameter_declarations),
        variables=_values(root.variable_declarations),
        entities={entity.name: body for entity, given in objects if (body := _body(entity, given)) is not None},
        external={entity.name: body for entity, body in objects if isinstance(body, model.ExternalObjectReference)},
        controllers={entity.name: _controllers(entity, library.entries) for entity, _ in objects},
        road_file=road_file,
        warnings=warnings,
        entries=library.entries,
        text=document.text,
        source=source,
        assigned=assignments,
        digest=document.digest,
        catalogs=library.digests,
        catalog_files=library.files,
        scope=Scope(parameters=dict(read.parameters), budget=collector.budget),
    )


def _body(entity: model.ScenarioObject, body: model.Element | None) -> EntityObject | None:
    """Return the body of an entity; an external object has a body without size."""
    if isinstance(body, model.ExternalObjectReference):
        box = model.BoundingBox(
            center=model.Center(x=0.0, y=0.0, z=0.0), dimensions=model.Dimensions(length=0.0, width=0.0, height=0.0)
        )
        return model.MiscObject(
            name=body.name,
            mass=0.0,
            misc_object_category=model.MiscObjectCategory.NONE,
            bounding_box=box,
            line=entity.line,
            source=entity.source,
        )
    return body if isinstance(body, model.Vehicle | model.Pedestrian | model.MiscObject) else None


def _values(declarations: model.ParameterDeclarations | model.VariableDeclarations | None) -> dict[str, str]:
    children: Any = declarations.children() if declarations is not None else ()
    return {declaration.name: declaration.value for declaration in children}


def _controllers(
    entity: model.ScenarioObject, entries: Mapping[model.CatalogReference, model.Element]
) -> tuple[model.Controller, ...]:
    controllers = (
        entries.get(assigned.catalog_reference) if assigned.catalog_reference else assigned.controller
        for assigned in entity.object_controller
    )
    return tuple(controller for controller in controllers if isinstance(controller, model.Controller))


def _other_kind(root: model.OpenScenario, name: str) -> Diagnostic:
    """Return the error for a catalog or a parameter value distribution."""
    if root.catalog is not None:
        kind, hint, line = "catalog", "specify a scenario that refers to it", root.catalog.line
    else:
        distribution = root.parameter_value_distribution
        assert distribution is not None
        kind, line = "parameter value distribution", distribution.line
        hint = f"its scenario is {distribution.scenario_file.filepath!r}"
    return Diagnostic(f"the file is a {kind}, not a scenario", hint, name, line)


class EntitySelections:
    """Entity selections of one scenario.

    declared  selections by name; an entity precedes a selection of the same name
    """

    def __init__(self, scenario: Scenario) -> None:
        self._entities_by_type = scenario.entities_by_type
        entities = scenario.document.entities
        declarations = entities.entity_selection if entities is not None else ()
        self.declared: Mapping[str, model.EntitySelection] = {
            selection.name: selection for selection in declarations if selection.name not in scenario.entities
        }

    def members(self, name: str) -> list[str]:
        """Return the entity of this name, or the members of the selection. Raise ScenarioError for a cycle."""
        return list(dict.fromkeys(self._members(name, ())))

    def _members(self, name: str, parents: tuple[str, ...]) -> Iterator[str]:
        group = self.declared.get(name)
        if group is None:
            yield name
            return
        if name in parents:
            text = f"selection {name!r} is a member of itself"
            raise ScenarioError(Diagnostic.at(group, text, "remove it from its members"))
        for ref in group.members.entity_ref:
            yield from self._members(ref.entity_ref, (*parents, name))
        for entry in group.members.by_type:
            yield from self._entities_by_type.get(entry.object_type, ())
