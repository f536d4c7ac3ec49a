"""Text output of runs: log, CSV table, explanations of triggers."""
