"""Statistics of repeated runs: samples, proportions, paired comparisons and sequential tests."""
