"""Scenario objects of a scenario, including trailers, and their bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eidrive_scenario.openscenario.model import CatalogReference, Element, Entities, ScenarioObject, Vehicle


def scenario_objects(
    entities: Entities | None, entries: Mapping[CatalogReference, Element]
) -> Iterator[tuple[ScenarioObject, Element | None]]:
    """Yield every scenario object and its body, trailers after their towing vehicles; None for an unknown body."""
    for one in entities.scenario_object if entities else ():
        yield from _with_trailers(one, entries)


def _with_trailers(
    one: ScenarioObject, entries: Mapping[CatalogReference, Element]
) -> Iterator[tuple[ScenarioObject, Element | None]]:
    body: Element | None = (
        one.vehicle or one.pedestrian or one.misc_object or one.external_object_reference or one.sensor
    )
    if body is None and one.catalog_reference is not None:
        body = entries.get(one.catalog_reference)
    yield one, body
    if isinstance(body, Vehicle) and body.trailer is not None and body.trailer.trailer is not None:
        yield from _with_trailers(body.trailer.trailer, entries)
