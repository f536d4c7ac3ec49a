"""Renderer: rasterization and illumination in numpy only, with identical results on all machines."""
