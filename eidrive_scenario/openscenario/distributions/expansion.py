"""The concrete runs that a distribution file stands for, one by one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import overload

from eidrive_scenario.errors import Diagnostic, ScenarioError, quoted, suggestion
from eidrive_scenario.files.bounded import is_folder, is_regular_file
from eidrive_scenario.library import place_of
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.distributions.deterministic import CartesianProduct, combinations_of
from eidrive_scenario.openscenario.distributions.stochastic import StochasticSampler, draws_of
from eidrive_scenario.openscenario.model import File, OpenScenario, ParameterValueDistribution
from eidrive_scenario.openscenario.reading.document import read_root
from eidrive_scenario.openscenario.reading.parsing import Source, open_document
from eidrive_scenario.openscenario.values.parameters import Assignment

_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class ConcreteRun:
    """A scenario with a value for each parameter that its distribution varies.

    number        of the run among those of the file, from 0 on
    assignments   values by parameter, each with the line that gave it; `load_scenario` takes them as they are
    """

    scenario: Path
    number: int
    assignments: Mapping[str, Assignment]

    @property
    def parameters(self) -> dict[str, str]:
        """The values by parameter."""
        return {name: assignment.text for name, assignment in self.assignments.items()}

    def __str__(self) -> str:
        """For human eyes, as `Speed=10,Model=car`; of a path only the last part."""
        return ",".join(f"{name}={PurePosixPath(text).name or text}" for name, text in self.parameters.items())


class DistributionExpansion(Sequence[ConcreteRun]):
    """All runs of a distribution file, counted and numbered, but made only when one is asked for.

    source      what messages call the file
    scenario    the file that is run
    varied      deterministic distributions combined in the order of the file, the last one changing from run to run;
                or stochastic ones, where a run is the same whichever runs were asked for before
    warnings    what the file's version of the standard deprecates
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
        """A run by its number, or several. Raises IndexError."""
        if isinstance(index, slice):
            return tuple(self[each] for each in range(*index.indices(len(self))))
        number = range(len(self))[index]
        return ConcreteRun(self.scenario, number, self.varied.at(number))

    def spread(self, count: int) -> Sequence[int]:
        """Numbers of `count` runs, or of all if there are no more, ascending.

        Combinations are picked all over: a part of them leaves out no value of a parameter that varies fast, and jumps
        evenly through those that vary slowly. A greater count adds runs to those of a smaller one. Of draws, which are
        alike, it is the first.
        """
        if count >= len(self) or isinstance(self.varied, StochasticSampler):
            return range(min(count, len(self)))
        # Steps of the golden ratio are the most even ones for any count (Weyl); without a common divisor they meet
        # every run before one comes again, and in the digits of a mixed radix every value.
        step = next(step for step in itertools.count(round(len(self) * _GOLDEN)) if math.gcd(step, len(self)) == 1)
        return sorted(index * step % len(self) for index in range(count))


def load_distribution(source: Source, *, seed: float = 1) -> DistributionExpansion:
    """Reads a parameter value distribution.

    seed    of the draws where a stochastic distribution names no randomSeed itself

    The scenario's path counts from the folder of the distribution; where that is no file, as in Python, it need not
    be there, which is a warning: its runs are those of any scenario. The scenario itself is not read: whether it has
    the parameters, and whether their constraints allow the values, comes out when a run is loaded.
    Raises ScenarioError with everything that is wrong with the file, each as file:line.
    """
    document = open_document(source)
    collector = DiagnosticCollector()
    read = read_root(document, collector)
    distribution = read.root.parameter_value_distribution if read is not None else None
    if read is None or distribution is None or collector.errors:
        collector.raise_on_error()
        raise ScenarioError(_other_kind(read.root if read else None, document.name))
    varied = _varied(distribution, seed, collector)
    report = collector.error if document.path is not None else collector.warning
    scenario = _scenario_file(distribution.scenario_file, document.folder, report)
    return DistributionExpansion(document.name, scenario, varied, collector.raise_on_error())


def _varied(
    distribution: ParameterValueDistribution, seed: float, collector: DiagnosticCollector
) -> CartesianProduct | StochasticSampler:
    if distribution.stochastic is not None:
        return draws_of(distribution.stochastic, seed, collector)
    assert distribution.deterministic is not None
    return combinations_of(distribution.deterministic, collector)


def _scenario_file(given: File, folder: Path, report: Callable[..., None]) -> Path:
    path = place_of(given.filepath.strip().replace("\\", "/"), folder)
    if not is_regular_file(path):
        beside = path.parent.glob("*.xosc") if is_folder(path.parent) else ()
        report(
            f"no scenario {quoted(given.filepath)}",
            suggestion(path.stem, {file.stem for file in beside}),
            source=given.source,
            line=given.line,
        )
    return path


def _other_kind(root: OpenScenario | None, name: str) -> Diagnostic:
    kind = "catalog" if root is not None and root.catalog is not None else "scenario"
    return Diagnostic(
        f"this is a {kind}, not a distribution of parameter values", "", name, root.line if root else None
    )
