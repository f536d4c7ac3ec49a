"""Repetitions, statistics, and the paper's tables."""
