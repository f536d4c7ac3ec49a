"""Sweeps: many runs over parameters, settings and seeds, whose results land in a store."""
