"""Fusion of the object lists of several stations into one object list."""
