"""Fixtures of the tests of reports."""

from command_fixtures import eidrive
from street_frames import street

__all__ = ["eidrive", "street"]
