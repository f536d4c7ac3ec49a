"""Sensors. Apart from the criteria, only sensors read the true state of the world."""
