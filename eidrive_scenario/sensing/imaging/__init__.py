"""Imaging of a camera: lens, exposure, noise."""
