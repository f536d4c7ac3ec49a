"""Expansion of a parameter value distribution to concrete runs, on demand."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import overload

from eidrive_scenario.errors import Diagnostic, ScenarioError, quoted, suggestion
from eidrive_scenario.extensions.library import from_library, resolve_path
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.distributions.deterministic import CartesianProduct, combinations_of
from eidrive_scenario.openscenario.distributions.stochastic import StochasticSampler, draws_of
from eidrive_scenario.openscenario.loading import ConcreteRun
from eidrive_scenario.openscenario.reading.document import read_root
from eidrive_scenario.openscenario.reading.parsing import Source, open_document

_GOLDEN = (math.sqrt(5) - 1) / 2


class DistributionExpansion(Sequence[ConcreteRun]):
    """Sequence of all runs of a distribution file; a run is created on access.

    source    name of the file in messages
    scenario  path of the scenario file
    varied    product of the deterministic distributions in the order of the file, the last one varying fastest; or
              stochastic ones, for which a run does not depend on the runs that were accessed before
    warnings  warnings of the reader, such as deprecated elements
    """

    def __init__(
        self,
        source: str,
        scenario: Path,
        varied: CartesianProduct | StochasticSampler,
        warnings: tuple[Diagnostic, ...] = (),
    ) -> None:
        self.source = source
        self.scenario = scenario
        self.varied = varied
        self.warnings = warnings

    def __len__(self) -> int:
        return self.varied.count

    @overload
    def __getitem__(self, index: int) -> ConcreteRun: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[ConcreteRun, ...]: ...
    def __getitem__(self, index: int | slice) -> ConcreteRun | tuple[ConcreteRun, ...]:
        """Return a run by its number, or several. Raise IndexError if the number is too large."""
        if isinstance(index, slice):
            return tuple(self[each] for each in range(*index.indices(len(self))))
        number = range(len(self))[index]
        return ConcreteRun(self.scenario, number, self.varied.at(number))

    def spread(self, count: int) -> Sequence[int]:
        """Return the ascending numbers of at most `count` runs.

        Combinations are selected evenly: a selection covers all values of parameters that vary fast, and evenly spaced
        ones of those that vary slowly. A larger count adds runs to those of a smaller one. Of random draws, the first
        ones are selected.
        """
        return range(len(self)) if count >= len(self) else sorted(itertools.islice(self.draws(), max(count, 0)))

    def draws(self) -> Iterator[int]:
        """Yield the numbers of all runs, each once, in the order in which `spread` selects them."""
        if isinstance(self.varied, StochasticSampler):
            yield from range(len(self))
            return
        # Steps of the golden ratio are the most even ones for any count (Weyl); a step without a common divisor reaches
        # every run before it repeats one, and every value of each digit of the mixed radix.
        step = next(step for step in itertools.count(round(len(self) * _GOLDEN)) if math.gcd(step, len(self)) == 1)
        yield from (index * step % len(self) for index in range(len(self)))


def load_distribution(source: Source, *, seed: float = 1) -> DistributionExpansion:
    """Read a parameter value distribution.

    source  path, library name, or any other source of `load_scenario`
    seed    seed of the draws if a stochastic distribution has no randomSeed

    The path of the scenario is relative to the folder of the distribution. A missing scenario is an error for a
    distribution from a file, and a warning otherwise, as in Python. The scenario itself is not read: its parameters
    and their constraints are checked when a run is loaded. Raise ScenarioError with all errors of the file.
    """
    if isinstance(source, str | os.PathLike):
        source = from_library(source)
    document = open_document(source)
    collector = DiagnosticCollector()
    read = read_root(document, collector)
    distribution = read.root.parameter_value_distribution if read is not None else None
    if read is None or distribution is None or collector.errors:
        collector.raise_on_error()
        assert read is not None  # an unknown version is an error
        kind = "catalog" if read.root.catalog is not None else "scenario"
        message = f"the file is a {kind}, not a parameter value distribution"
        raise ScenarioError(Diagnostic(message, "", document.name, read.root.line))
    varied: CartesianProduct | StochasticSampler
    if distribution.stochastic is not None:
        varied = draws_of(distribution.stochastic, seed, collector)
    else:
        assert distribution.deterministic is not None
        varied = combinations_of(distribution.deterministic, collector)
    file = distribution.scenario_file
    path = resolve_path(file.filepath, document.folder)
    if not is_regular_file(path):
        report = collector.error if document.path is not None else collector.warning
        siblings = path.parent.glob("*.xosc") if os.path.isdir(path.parent) else ()
        hint = suggestion(path.stem, {sibling.stem for sibling in siblings})
        report(f"ScenarioFile: scenario {quoted(file.filepath)} does not exist", hint, at=file)
    return DistributionExpansion(document.name, path, varied, collector.raise_on_error())
