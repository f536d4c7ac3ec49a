"""Parameter value distributions: a scenario and the values of its parameters over which it is run."""

from eidrive_scenario.openscenario.distributions.deterministic import CartesianProduct, ListedValues
from eidrive_scenario.openscenario.distributions.expansion import ConcreteRun, DistributionExpansion, load_distribution
from eidrive_scenario.openscenario.distributions.stochastic import StochasticSampler

__all__ = [
    "CartesianProduct",
    "ConcreteRun",
    "DistributionExpansion",
    "ListedValues",
    "StochasticSampler",
    "load_distribution",
]
