"""Distributions of parameter values over runs."""

from __future__ import annotations

from eidrive_scenario.openscenario.model.declarations import File, ParameterAssignment, ParameterName, UnsignedInt
from eidrive_scenario.openscenario.model.element import (
    ALL,
    CHOICE,
    Choice,
    Element,
    about,
    child,
    choice,
    sequence,
    text,
)


class Range(Element):
    """Range from a lower to an upper limit."""

    lower_limit: float
    upper_limit: float


class DistributionSetElement(Element):
    """Value of a distribution."""

    value: str


class DistributionSet(Element):
    """Listed values, with one run each."""

    element: tuple[DistributionSetElement, ...]


class DistributionRange(Element, content=ALL):
    """Values from a range in equal steps."""

    step_width: float
    range: Range


class UserDefinedDistribution(Element):
    """Distribution that is specific to a tool."""

    type: str
    content: str = text()


class DeterministicSingleParameterDistribution(Element, content=CHOICE):
    """Deterministic values of one parameter."""

    parameter_name: ParameterName
    distribution_set: DistributionSet | None = None
    distribution_range: DistributionRange | None = None
    user_defined_distribution: UserDefinedDistribution | None = None
    sibling_index: int = about(0)


class ParameterValueSet(Element):
    """Values of several parameters for one run."""

    parameter_assignment: tuple[ParameterAssignment, ...]


class ValueSetDistribution(Element):
    """Sets of values, with one run each."""

    parameter_value_set: tuple[ParameterValueSet, ...]


class DeterministicMultiParameterDistribution(Element):
    """Deterministic values of several parameters together."""

    value_set_distribution: ValueSetDistribution
    sibling_index: int = about(0)


class Deterministic(Element, content=Choice(minimum=0, maximum=None)):
    """Deterministic distributions, whose combinations are the runs."""

    deterministic_multi_parameter_distribution: tuple[DeterministicMultiParameterDistribution, ...] = ()
    deterministic_single_parameter_distribution: tuple[DeterministicSingleParameterDistribution, ...] = ()


class ProbabilityDistributionSetElement(Element):
    """Value and its weight."""

    value: str
    weight: float


class ProbabilityDistributionSet(Element):
    """Values, drawn by their weights."""

    element: tuple[ProbabilityDistributionSetElement, ...]


class NormalDistribution(Element):
    """Normal distribution, truncated at a range."""

    expected_value: float
    variance: float
    range: Range | None = None


class LogNormalDistribution(Element):
    """Log-normal distribution, truncated at a range."""

    expected_value: float
    variance: float
    range: Range | None = None


class UniformDistribution(Element):
    """Uniform distribution over a range."""

    range: Range


class PoissonDistribution(Element):
    """Poisson distribution, truncated at a range."""

    expected_value: float
    range: Range | None = None


class HistogramBin(Element):
    """Range and its weight."""

    weight: float
    range: Range


class Histogram(Element):
    """Ranges, drawn by their weights."""

    bin: tuple[HistogramBin, ...]


class StochasticDistribution(Element, content=CHOICE):
    """Stochastic distribution of one parameter."""

    parameter_name: ParameterName
    probability_distribution_set: ProbabilityDistributionSet | None = None
    normal_distribution: NormalDistribution | None = None
    log_normal_distribution: LogNormalDistribution | None = child(since="1.3")
    uniform_distribution: UniformDistribution | None = None
    poisson_distribution: PoissonDistribution | None = None
    histogram: Histogram | None = None
    user_defined_distribution: UserDefinedDistribution | None = None


class Stochastic(Element):
    """Stochastic distributions, drawn for a number of runs."""

    number_of_test_runs: UnsignedInt
    random_seed: float | None = None
    stochastic_distribution: tuple[StochasticDistribution, ...]


class ParameterValueDistribution(Element, content=sequence("scenario_file", choice("deterministic", "stochastic"))):
    """Values of the parameters over which a scenario is run."""

    scenario_file: File
    deterministic: Deterministic | None = None
    stochastic: Stochastic | None = None
