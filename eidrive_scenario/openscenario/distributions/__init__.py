"""Parameter value distributions: a scenario and the values of its parameters over which it is run."""

from typing import TYPE_CHECKING

from eidrive_scenario.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.distributions.deterministic import CartesianProduct, ListedValues
    from eidrive_scenario.openscenario.distributions.expansion import (
        DistributionExpansion,
        load_distribution,
    )
    from eidrive_scenario.openscenario.distributions.stochastic import StochasticSampler
else:
    __getattr__ = lazy_exports(
        __name__,
        {
            "deterministic": "CartesianProduct ListedValues",
            "expansion": "DistributionExpansion load_distribution",
            "stochastic": "StochasticSampler",
        },
    )

__all__ = [
    "CartesianProduct",
    "DistributionExpansion",
    "ListedValues",
    "StochasticSampler",
    "load_distribution",
]
