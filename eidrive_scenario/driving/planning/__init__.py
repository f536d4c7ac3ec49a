"""Planners: routes, reference paths, stops at signals, trajectories."""
