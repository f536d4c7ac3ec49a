"""Check of a catalog file by itself, without a scenario that uses it."""

from __future__ import annotations

from pathlib import Path

from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario.catalogs import twins_in
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, sort_diagnostics
from eidrive_scenario.openscenario.model import OpenScenario
from eidrive_scenario.openscenario.reading.document import VERSIONS, version_of
from eidrive_scenario.openscenario.reading.parsing import open_document
from eidrive_scenario.openscenario.reading.reader import Reader
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.validation.rules import check_values


def check_catalog(path: Path) -> tuple[tuple[Diagnostic, ...], tuple[Diagnostic, ...]]:
    """Return the errors and the warnings of a catalog file.

    Each entry is read with the defaults of the parameters that it declares. What an entry refers to in other catalogs
    is checked with the scenarios that use it, as only these name the folders.
    """
    collector = DiagnosticCollector()
    try:
        document = open_document(path)
        version = version_of(document, collector, older=VERSIONS[0])
        if version is not None:
            tree = apply_workarounds(document.root, document.name, version, collector)
            root = Reader(document.name, version, collector).read(tree, OpenScenario)
            check_values(list(root.walk()), version, collector)
        catalog = document.root.find("Catalog")
        if catalog is not None:
            collector.errors.extend(twins_in(catalog, document.name).values())
    except ScenarioError as error:
        collector.errors.extend(error.diagnostics)
    return tuple(sort_diagnostics(collector.errors)), tuple(sort_diagnostics(collector.warnings))
