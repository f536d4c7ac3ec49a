"""Experiments: single runs with output files, repetitions, statistics, and the tables of the paper."""
