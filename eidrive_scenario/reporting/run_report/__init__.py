"""The report over many runs: groups, statistics, one HTML page."""
