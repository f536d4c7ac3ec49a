"""Poses on roads and the search for the lane at a point."""
