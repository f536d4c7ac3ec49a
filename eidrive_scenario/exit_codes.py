"""Exit codes of runs and of the command line (see docs/results.md)."""

PASSED = 0
FAILED = 1
"""A criterion failed."""
INVALID_INPUT = 2
"""The input is invalid; nothing was run."""
ABORTED = 3
"""The run was aborted, or reached its time limit."""
NOT_JUDGED = 4
"""The run ended, and no criterion judged it."""
