"""Catalogs of the library and their entries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from eidrive_scenario.extensions.library import CATALOGS, library_path
from eidrive_scenario.openscenario.model import Element, MiscObject, Pedestrian, Vehicle
from eidrive_scenario.openscenario.reading.document import read_document


@dataclass(frozen=True)
class CatalogEntry:
    """Entry of a catalog.

    catalog    name of the catalog
    name       name of the entry
    kind       element of the standard, such as `Vehicle`
    category   category of the standard, such as `car`; "" if the kind has none
    size       length, width and height [m]; None for entries without a bounding box
    mass       mass [kg]; None if the file omits it
    """

    catalog: str
    name: str
    kind: str
    category: str = ""
    size: tuple[float, float, float] | None = None
    mass: float | None = None


def library_catalog_entries() -> Iterator[CatalogEntry]:
    """Yield the entries of all catalogs of the library, catalog by catalog, in the order of the files."""
    for path in sorted((library_path() / CATALOGS).glob("*.xosc")):
        catalog = read_document(path).catalog
        if catalog is not None:
            for element in catalog.children():
                yield _entry(catalog.name or path.stem, element)


def _entry(catalog: str, element: Element) -> CatalogEntry:
    name = str(getattr(element, "name", ""))
    kind = type(element).__name__
    if isinstance(element, Vehicle):
        category = element.vehicle_category.value
    elif isinstance(element, Pedestrian):
        category = element.pedestrian_category.value
    elif isinstance(element, MiscObject):
        category = element.misc_object_category.value
    else:
        return CatalogEntry(catalog, name, kind)
    dimensions = element.bounding_box.dimensions
    size = (dimensions.length, dimensions.width, dimensions.height)
    return CatalogEntry(catalog, name, kind, category, size, element.mass)
