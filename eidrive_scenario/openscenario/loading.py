"""Load a scenario for one run: from any source, with the parameters that its seed draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from eidrive_scenario.errors import ErrorCollector
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.openscenario.distributions import ConcreteRun
from eidrive_scenario.openscenario.reading.parsing import Source
from eidrive_scenario.openscenario.scenario import Scenario, load_scenario
from eidrive_scenario.openscenario.values.parameters import Assignment, as_assignments
from eidrive_scenario.openscenario.variation import drawn_parameters


def load_for_seed(
    source: Scenario | Source | ConcreteRun, seed: int, parameters: Mapping[str, str | Assignment] | None = None
) -> Scenario:
    """Load a scenario with the parameters that its `eidrive.variation` commands draw for this seed.

    source      path, library name, one run of a distribution, a Scenario that is loaded already (returned as it is if
                no parameter changes), or any other source of `load_scenario`
    parameters  values that win over drawn ones and over those of the distribution

    Raises ScenarioError for a wrong file, SettingError for a wrong variation.
    """
    scenario = _load(source, parameters)
    return _draw(scenario, seed, parameters)


def _load(source: Scenario | Source | ConcreteRun, parameters: Mapping[str, str | Assignment] | None) -> Scenario:
    if isinstance(source, Scenario):
        return source
    if isinstance(source, ConcreteRun):
        return load_scenario(source.scenario, {**source.assignments, **(parameters or {})})
    return load_scenario(resolve_scenario(source) if isinstance(source, str | Path) else source, parameters)


def _draw(scenario: Scenario, seed: int, parameters: Mapping[str, str | Assignment] | None) -> Scenario:
    """The scenario with what the caller assigns and the seed draws; loaded again only if that changes a value."""
    given = {**scenario.assigned, **as_assignments(parameters)}
    drawn = {name: Assignment(text) for name, text in drawn_parameters(scenario, seed).items() if name not in given}
    wanted = {**drawn, **given}
    if all(scenario.parameters.get(name) == value.text for name, value in wanted.items()):
        return scenario
    return replace(load_scenario(scenario.source, wanted), assigned=given)


def load_for_run(
    source: Scenario | Source | ConcreteRun,
    seed: int,
    parameters: Mapping[str, str | Assignment],
    together: ErrorCollector,
) -> Scenario:
    """As `load_for_seed`; a wrong variation is one of several mistakes that are reported at once."""
    scenario = _load(source, parameters)
    with together:
        scenario = _draw(scenario, seed, parameters)
    return scenario
