"""Fixtures of command line tests."""

from command_fixtures import eidrive, passing_by

__all__ = ["eidrive", "passing_by"]
