"""Drawings of roads, scenes and measurements for pages and images."""
