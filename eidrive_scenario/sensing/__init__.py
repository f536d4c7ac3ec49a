"""Sensors: with the criteria, the only readers of the world's truth."""
