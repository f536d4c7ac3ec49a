"""A whole file: its header, the version it is written for, and its root element."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

from lxml import etree

from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import OpenScenario
from eidrive_scenario.openscenario.reading.parsing import Document, Source, line_of, open_document
from eidrive_scenario.openscenario.reading.reader import FoundReference, Reader
from eidrive_scenario.openscenario.reading.workarounds import apply_workarounds
from eidrive_scenario.openscenario.values.parameters import Assignment, Parameter
from eidrive_scenario.openscenario.values.scalars import Version

VERSIONS: tuple[Version, ...] = ((1, 0), (1, 1), (1, 2), (1, 3))
ROOTS = ("OpenSCENARIO", "OpenScenario")
"""The schema declares both spellings."""


@dataclass(frozen=True)
class ReadDocument:
    """What a file holds, with the catalog references that are still to be resolved."""

    root: OpenScenario
    version: Version
    references: tuple[FoundReference, ...]
    parameters: dict[str, Parameter]


def read_document(source: Source) -> OpenScenario:
    """The root element of a scenario, a catalog or a parameter value distribution, with its parameters put in.

    Checks the file itself, not what it refers to. Raises ScenarioError with all findings as file:line.
    """
    collector = DiagnosticCollector()
    read = read_root(open_document(source), collector)
    collector.raise_on_error()
    assert read is not None
    return read.root


def read_root(
    document: Document, collector: DiagnosticCollector, assignments: Mapping[str, Assignment] | None = None
) -> ReadDocument | None:
    """Reads a parsed file; None where it is not even recognizable as one of the versions known."""
    version = version_of(document, collector)
    if version is None:
        return None
    reader = Reader(document.name, version, collector)
    tree = apply_workarounds(document.root, document.name, version, collector)
    root = cast(OpenScenario, reader.read(tree, OpenScenario, assignments))
    declared = reader.declared if root.parameter_declarations else None
    return ReadDocument(root, version, tuple(reader.references), declared.parameters if declared else {})


def version_of(document: Document, collector: DiagnosticCollector, older: Version | None = None) -> Version | None:
    """The version that the header names, if it is a known one; else that is a finding.

    older  what a file of revMajor 0 is taken for, with a warning
    """
    root = document.root
    if root.tag not in ROOTS:
        name = etree.QName(root)
        in_namespace = bool(name.namespace) and name.localname in ROOTS
        collector.error(
            f"the root element is {root.tag}, not OpenSCENARIO",
            f"take xmlns={name.namespace!r} out: the standard has no namespace"
            if in_namespace
            else "is this another kind of file?",
            source=document.name,
            line=line_of(root),
        )
        return None
    header = root.find("FileHeader")
    if header is None:
        collector.error(
            "OpenSCENARIO lacks the element FileHeader",
            "its revMajor and revMinor say which version the file is written for",
            source=document.name,
            line=line_of(root),
        )
        return None
    return _revision(header, document, collector, older)


def _revision(
    header: etree._Element, document: Document, collector: DiagnosticCollector, older: Version | None
) -> Version | None:
    numbers = []
    for name in ("revMajor", "revMinor"):
        text = header.get(name)
        if text is None or not (text.strip().isascii() and text.strip().isdigit()):
            what = f"lacks the attribute {name!r}" if text is None else f"has the {name} {text!r}"
            collector.error(f"FileHeader {what}", "1.3 is 1 and 3", source=document.name, line=line_of(header))
            return None
        numbers.append(int(text.strip()[:9]))
    version = (numbers[0], numbers[1])
    if version in VERSIONS:
        return version
    known = "known are " + ", ".join(f"{major}.{minor}" for major, minor in VERSIONS)
    report = collector.warning if older and version < older else collector.error
    message = f"the file is written for OpenSCENARIO {version[0]}.{version[1]}"
    report(message, known, source=document.name, line=line_of(header))
    return older if older and version < older else None
