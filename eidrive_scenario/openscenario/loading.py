"""Loading of a scenario for one run: from any source, with the parameters that its seed draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from eidrive_scenario.errors import ErrorCollector
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.openscenario.distributions import ConcreteRun
from eidrive_scenario.openscenario.kept_scenarios import load_kept
from eidrive_scenario.openscenario.reading.parsing import Source
from eidrive_scenario.openscenario.scenario import Scenario, load_scenario
from eidrive_scenario.openscenario.values.parameters import Assignment, as_assignments
from eidrive_scenario.openscenario.variation import drawn_parameters


def load_for_seed(
    source: Scenario | Source | ConcreteRun, seed: int, parameters: Mapping[str, str | Assignment] | None = None
) -> Scenario:
    """Load a scenario with the parameters that its `eidrive.variation` commands draw for this seed.

    source      path, library name, one run of a distribution, a loaded Scenario (returned itself if no parameter
                changes), or any other source of `load_scenario`
    parameters  values that take precedence over drawn ones and over those of the distribution

    Raise ScenarioError for an invalid file, InputError for an invalid variation.
    """
    scenario = _load(source, parameters)
    return _draw(scenario, seed, parameters)


def _load(source: Scenario | Source | ConcreteRun, parameters: Mapping[str, str | Assignment] | None) -> Scenario:
    if isinstance(source, Scenario):
        return source
    if isinstance(source, ConcreteRun):
        return load_kept(source.scenario, {**source.assignments, **(parameters or {})})
    if isinstance(source, str | Path):
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
