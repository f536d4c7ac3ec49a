"""Frames, trace hashes, recordings and text output of runs."""
