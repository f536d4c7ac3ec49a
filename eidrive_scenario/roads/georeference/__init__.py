"""Geodetic reference of a road map."""
