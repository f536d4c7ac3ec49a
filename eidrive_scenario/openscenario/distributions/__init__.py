"""Parameter value distributions: a file that names a scenario and over which values of its parameters it is run."""

from eidrive_scenario.openscenario.distributions.unfolding import ConcreteRun, Unfolding, load_distribution

__all__ = ["ConcreteRun", "Unfolding", "load_distribution"]
