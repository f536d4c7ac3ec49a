"""Parameter value distributions: a file that names a scenario and over which values of its parameters it is run."""

from eidrive_scenario.openscenario.distributions.deterministic import Combinations, Listed
from eidrive_scenario.openscenario.distributions.stochastic import Draws
from eidrive_scenario.openscenario.distributions.unfolding import ConcreteRun, Unfolding, load_distribution

__all__ = ["Combinations", "ConcreteRun", "Draws", "Listed", "Unfolding", "load_distribution"]
