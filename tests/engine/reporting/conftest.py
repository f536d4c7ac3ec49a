"""Fixtures of the tests of pages and drawings."""

from street_frames import street

__all__ = ["street"]
