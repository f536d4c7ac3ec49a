"""Fixtures of the tests of `eidrive check`."""

from command_fixtures import eidrive, passing_by

__all__ = ["eidrive", "passing_by"]
