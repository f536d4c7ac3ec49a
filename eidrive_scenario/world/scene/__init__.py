"""Visible content of the world: bodies, roadside objects and lamps as meshes."""
