"""Text output: run log, CSV, explanations of triggers."""
