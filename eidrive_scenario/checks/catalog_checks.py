"""Check of a catalog file without a scenario that uses it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from eidrive_scenario.checks.registry import check_rule_names
from eidrive_scenario.checks.report import CheckReport
from eidrive_scenario.checks.rule import Level
from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario.catalogs import duplicate_entries
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import OpenScenario
from eidrive_scenario.openscenario.reading.document import VERSIONS, version_of
from eidrive_scenario.openscenario.reading.parsing import open_document
from eidrive_scenario.openscenario.reading.reader import Reader
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.validation.rules import check_values


def check_catalog(path: Path, ignored: Collection[str] = ()) -> CheckReport:
    """Check a catalog file. No rule applies to a catalog without a scenario.

    Each entry is read with the defaults of the parameters that it declares. References of an entry to other catalogs
    are checked with the scenarios that use it, as only these define the folders. Raise SettingError if `ignored` has
    an unknown name.
    """
    check_rule_names(ignored)
    return CheckReport.collect(_diagnostics(path))


def _diagnostics(path: Path) -> Iterator[tuple[Level, Diagnostic]]:
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
            collector.errors.extend(duplicate_entries(catalog, document.name).values())
    except ScenarioError as error:
        collector.errors.extend(error.diagnostics)
    yield from ((Level.ERROR, diagnostic) for diagnostic in collector.errors)
    yield from ((Level.WARNING, diagnostic) for diagnostic in collector.listed_warnings())
