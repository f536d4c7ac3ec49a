"""Renderer: rasterization and lighting in numpy only, with identical results on all machines."""
