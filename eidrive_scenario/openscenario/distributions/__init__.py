"""Parameter value distributions: a scenario and the values of its parameters over which it is run."""
