"""Replay of a recorded run as one HTML file."""
