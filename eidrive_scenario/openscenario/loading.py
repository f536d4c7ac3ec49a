"""Loading of a scenario for one run: from any source, with the parameters that its seed draws.

Scenarios stay in the process, so that each run of a sweep does not read the same files again.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from eidrive_scenario.base.content_digest import sha256_of
from eidrive_scenario.base.randomness import checked_seed
from eidrive_scenario.errors import ErrorCollector
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.files.bounded import read_regular_file
from eidrive_scenario.openscenario.catalogs import CatalogLibrary
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.parsing import KeptFiles, Source
from eidrive_scenario.openscenario.scenario import Scenario, find_road_file, load_scenario
from eidrive_scenario.openscenario.values.parameters import Assignment, as_assignments
from eidrive_scenario.openscenario.variation import drawn_parameters

MAX_KEPT = 2**18
"""Maximum size of the files of all scenarios that are kept [byte]; their objects take about 40 times as much."""

Key = tuple[str, str, tuple[tuple[str, Assignment], ...]]
"""Path and SHA-256 of a scenario file, and the values of its parameters."""


_kept: KeptFiles[Key, tuple[Scenario, int]] = KeptFiles(MAX_KEPT)
"""Scenarios, and the characters of their expressions before the first run."""


def load_kept(path: Path, parameters: Mapping[str, str | Assignment] | None = None) -> Scenario:
    """Return the scenario of a file like `load_scenario`, without reading it again if all its files are unchanged.

    The contents of the scenario and of its catalogs are compared by their SHA-256, and the folders of catalogs by the
    names in them. Scenarios are immutable, so that runs can share one. Raise the errors of `load_scenario`.
    """
    assignments = as_assignments(parameters)
    try:
        content = read_regular_file(path, MAX_KEPT)
    except OSError:  # Larger, or an error that `load_scenario` reports
        return load_scenario(path, assignments)
    key = str(path), sha256_of(content), tuple(assignments.items())
    kept, concatenated = _kept.get(key) or (None, 0)
    if kept is not None and _is_current(kept, path):
        if kept.scope is not None:
            kept.scope.budget.concatenated = concatenated  # Each run may use the whole limit
        return kept
    scenario = load_scenario(path, assignments)
    if scenario.catalog_files is not None and scenario.scope is not None:
        key = key[0], scenario.digest, key[2]  # The content that was read, if the file has changed since
        _kept.put(key, (scenario, scenario.scope.budget.concatenated), len(content))
    return scenario


def _is_current(scenario: Scenario, path: Path) -> bool:
    """Whether the catalogs and the road file of a scenario would be found and read as before."""
    folder = path.parent
    collector = DiagnosticCollector()
    if find_road_file(scenario.document.road_network, folder, collector) != scenario.road_file:
        return False
    library = CatalogLibrary(scenario.document.catalog_locations, folder, {}, collector)
    return scenario.catalog_files is not None and scenario.catalog_files.are_current(library.folders)


@dataclass(frozen=True)
class ConcreteRun:
    """Scenario with a value for each parameter that its distribution varies.

    number       number of the run in the distribution, from 0
    assignments  values by parameter, each with its line in the file; an argument of `load_scenario`
    """

    scenario: Path
    number: int
    assignments: Mapping[str, Assignment]

    @property
    def parameters(self) -> dict[str, str]:
        """Return the values by parameter."""
        return {name: assignment.text for name, assignment in self.assignments.items()}

    def __str__(self) -> str:
        """Format the values as `Speed=10,Model=car`; of a path only the last part is shown."""
        return ",".join(f"{name}={PurePosixPath(text).name or text}" for name, text in self.parameters.items())


def load_for_seed(
    source: Scenario | Source | ConcreteRun, seed: int, parameters: Mapping[str, str | Assignment] | None = None
) -> Scenario:
    """Load a scenario with the parameters that its `eidrive.variation` commands draw for this seed.

    source      path, library name, one run of a distribution, a loaded Scenario (returned itself if no parameter
                changes), or any other source of `load_scenario`
    parameters  values that take precedence over drawn ones and over those of the distribution

    Raise ScenarioError for an invalid file, InputError for an invalid variation or seed.
    """
    return _draw(_load(source, parameters), checked_seed(seed), parameters)


def _load(source: Scenario | Source | ConcreteRun, parameters: Mapping[str, str | Assignment] | None) -> Scenario:
    if isinstance(source, Scenario):
        return source
    if isinstance(source, ConcreteRun):
        return load_kept(source.scenario, {**source.assignments, **(parameters or {})})
    if isinstance(source, str | os.PathLike):
        return load_kept(resolve_scenario(source), parameters)
    return load_scenario(source, parameters)


def _draw(scenario: Scenario, seed: int, parameters: Mapping[str, str | Assignment] | None) -> Scenario:
    """Return the scenario with assigned and drawn parameters; it is loaded again only if a value changes."""
    given = {**scenario.assigned, **as_assignments(parameters)}
    drawn = {name: Assignment(text) for name, text in drawn_parameters(scenario, seed).items() if name not in given}
    values = {**drawn, **given}
    if all(scenario.parameters.get(name) == value.text for name, value in values.items()):
        return scenario
    return replace(load_scenario(scenario.source, values), assigned=given)


def load_for_run(
    source: Scenario | Source | ConcreteRun,
    seed: int,
    parameters: Mapping[str, str | Assignment],
    collector: ErrorCollector,
) -> Scenario:
    """Load a scenario like `load_for_seed`; errors of its variation are stored in `collector`."""
    scenario = _load(source, parameters)
    with collector:
        scenario = _draw(scenario, seed, parameters)
    return scenario
