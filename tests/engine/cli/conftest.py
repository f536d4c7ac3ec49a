"""Fixtures of the tests of the command line."""

from command_fixtures import eidrive, passing_by

__all__ = ["eidrive", "passing_by"]
